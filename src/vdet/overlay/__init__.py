"""Drawing on frames: boxes, ids, heat, and pictures of every stage."""
