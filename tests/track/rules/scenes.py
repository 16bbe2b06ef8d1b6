"""What the tests of the rules tracker share: detections as it takes them."""

from collections.abc import Sequence

from vdet.boxes import NO_BOXES, Box, Boxes


def detections(boxes: Sequence[Box], peak: float = 2.0, score: float = 1.0) -> Boxes:
    """Give detections whose centroids are the centres of their boxes."""
    if not boxes:
        return NO_BOXES
    corners = [(box.x1, box.y1, box.x2, box.y2) for box in boxes]
    count = len(boxes)
    return Boxes(corners, [score] * count, data={"strength": [peak] * count})
