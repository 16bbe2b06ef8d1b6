"""`make bench`: how fast vdet is, as ratios against references measured in the same run."""
