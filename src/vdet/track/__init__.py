"""Detections of consecutive frames become tracks: the trackers, each behind one protocol."""
