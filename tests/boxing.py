"""Boxes in whole pixels."""

from vdet.boxes import Box, Boxes


def moved_to(box: Box, x: float, y: float) -> Box:
    """Return a box of the same size with its top-left corner at `(x, y)`."""
    return Box.sized(x, y, box.width, box.height)


def rounded(found: Boxes) -> list[Box]:
    """Return the boxes in whole pixels."""
    return [item.box.rounded for item in found]
