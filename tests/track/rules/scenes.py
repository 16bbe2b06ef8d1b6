"""What the tests of the rules tracker share: detections as it takes them."""

from collections.abc import Sequence

from vdet.boxes import Box
from vdet.detect.detections import NO_DETECTIONS, Detections


def detections(boxes: Sequence[Box], peak: float = 2.0, score: float = 1.0) -> Detections:
    """Give detections whose centroids are the centres of their boxes."""
    if not boxes:
        return NO_DETECTIONS
    corners = [(box.x, box.y, box.right, box.bottom) for box in boxes]
    count = len(boxes)
    return Detections(corners, [score] * count, strengths=[peak] * count)
