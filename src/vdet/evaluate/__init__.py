"""Comparison of detections and tracks with the truth, metrics, and how the results are shown."""
