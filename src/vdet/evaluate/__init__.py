"""Comparison of detections and tracks with the ground truth, metrics, and reports."""
