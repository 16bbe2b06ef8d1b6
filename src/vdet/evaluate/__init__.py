"""How well it works: the metrics of the trade, and what they are measured on.

`truth` and `predictions` read files of boxes, `scores` measures one against the other, `clips`
runs detection on labelled videos, `patches` measures the classifier, `report` makes HTML of either.
"""
