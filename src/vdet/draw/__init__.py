"""Boxes, labels and lines, drawn into BGR images or planes."""
