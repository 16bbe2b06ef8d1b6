"""Metrics of detection and tracking, and what they are computed from.

`truth` and `predictions` read files of boxes, `scores` compares one with the other, `clips` runs
detection on labelled videos, `report` makes HTML of the results.
"""
