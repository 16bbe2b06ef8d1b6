"""Trackers: they turn detections of consecutive frames into tracks, behind one protocol."""
