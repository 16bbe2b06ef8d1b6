"""Weak detections that stay in the view of a moving camera: it follows something unclear.

What stands beside the road passes by, and false alarms of single frames do not last. A fixed camera
always sees its signs and buildings, so this is not for fixed cameras.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from vdet.boxes import EDGE, Boxes, Float64Array, coverage, iou_matrix
from vdet.conditions.finding import Finding, joined, when
from vdet.media import Picture

_MIN_SCORE = 0.1
_MIN_WIDTH = 0.04
"""Minimum width of a detection, as a fraction of the frame's: smaller ones are countless."""
_COVERED = 0.5
"""Fraction of a detection inside a vehicle that is shown, or the reverse, if it belongs to it."""
_SAME_IOU, _GAP = 0.4, 0.5
"""Minimum overlap of consecutive detections of one object, and the maximum seconds between them."""
_SHORTEST = 3.0
"""Minimum seconds for which an object is seen."""


@dataclass(slots=True, eq=False)
class _Object:
    """What weak detections may show: the latest box, `(4,)`, and the times of all."""

    box: Float64Array
    times: list[float]

    @property
    def lasts(self) -> bool:
        """Whether it is seen for long enough."""
        return self.times[-1] - self.times[0] >= _SHORTEST


class WeakWatch:
    """Links the weak detections of one video."""

    def __init__(self) -> None:
        self._objects: list[_Object] = []

    def add(self, time: float, picture: Picture, detections: Boxes, shown: Float64Array) -> None:
        """Add a frame with its detections, and the boxes of the vehicles shown, `(n, 4)`."""
        boxes = _weak_boxes(picture, detections, shown)
        for item in self._objects:
            if time - item.times[-1] > _GAP or not len(boxes):
                continue
            overlaps = iou_matrix(item.box[np.newaxis], boxes)[0]
            best = int(overlaps.argmax())
            if overlaps[best] >= _SAME_IOU:
                item.box, boxes = boxes[best], np.delete(boxes, best, axis=0)
                item.times.append(time)
        self._objects = [
            item for item in self._objects if item.lasts or time - item.times[-1] <= _GAP
        ]
        self._objects += [_Object(box, [time]) for box in boxes]

    def findings(self) -> list[Finding]:
        """Return when something like a vehicle was followed that was too uncertain to show."""
        lasting = (item.times for item in self._objects if item.lasts)
        spans = joined(sorted(itertools.chain.from_iterable(lasting)))
        if not spans:
            return []
        text = (
            f"something ahead looks like a vehicle {when(spans)}, too uncertain to show: "
            "look at these times"
        )
        return [Finding("uncertain", text, tuple(spans))]


def _weak_boxes(picture: Picture, detections: Boxes, shown: Float64Array) -> Float64Array:
    """Return the boxes of weak detections apart from `shown`, and not of the camera's own vehicle.

    That one reaches the lower edge of the frame.
    """
    sides = detections.sides
    rows = detections.scores >= _MIN_SCORE
    rows &= sides[:, 2] - sides[:, 0] >= _MIN_WIDTH * picture.width
    rows &= sides[:, 3] < (1 - EDGE) * picture.height
    sides = sides[rows]
    inside = np.maximum(coverage(sides, shown), coverage(shown, sides).T)
    return np.asarray(sides[inside.max(axis=1, initial=0) < _COVERED])
