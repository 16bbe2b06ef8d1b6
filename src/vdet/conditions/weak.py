"""Weak detections that stay in view of a moving camera: possibly a vehicle ahead.

Objects beside the road leave the view, false detections in single frames do not last, and dirt on
the glass does not move in the frame. Before a fixed camera signs and buildings last, so this is not
for fixed cameras.
"""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np

from vdet.boxes import Box, Boxes, Float64Array, coverage, cut_sides, has_moved, iou_matrix
from vdet.findings import Finding
from vdet.media import Picture
from vdet.track.track import Track
from vdet.traffic.clock import joined, when

# These limits were set by hand. Half and twice of each change no finding of four real clips, 49 s,
# but where they say so.

_MIN_SCORE = 0.1
"""Minimum score of a detection."""
_MIN_WIDTH = 0.04
"""Minimum width of a detection, as a fraction of the frame's: smaller ones are too frequent."""
_COVERED = 0.5
"""A detection belongs to a track if more than this fraction of the detection is in the box of the
track, or of that box in the detection. If none did, a real clip would get a false finding.
"""
_SAME_IOU, _GAP = 0.4, 0.5
"""Minimum overlap of consecutive detections of one object, and the maximum seconds between them."""
_SHORTEST = 3.0
"""Minimum seconds between the first and the last detection of an object."""


@dataclass(slots=True, eq=False)
class _Object:
    """Linked detections of one object."""

    first: float
    last: float
    start: Box
    box: Box
    has_moved: bool = False

    @property
    def is_lasting(self) -> bool:
        """Whether it is detected for long enough, and is not fixed to the camera."""
        return self.last - self.first >= _SHORTEST and self.has_moved

    def add(self, time: float, box: Box) -> None:
        """Add the next detection."""
        self.last, self.box = time, box
        distance = math.dist(self.start.center, box.center)
        self.has_moved |= has_moved(distance, box.size)


class WeakWatch:
    """Links the weak detections of one video."""

    def __init__(self) -> None:
        self._objects: list[_Object] = []

    def add(
        self, time: float, picture: Picture, detections: Boxes, tracks: Sequence[Track]
    ) -> None:
        """Add a frame with its detections and its tracks."""
        boxes = _weak_boxes(picture, detections, tracks)
        for item in self._objects:
            if len(boxes) and time - item.last <= _GAP:
                overlaps = iou_matrix(np.array([astuple(item.box)]), boxes)[0]
                best = int(overlaps.argmax())
                if overlaps[best] >= _SAME_IOU:
                    item.add(time, Box(*boxes[best].tolist()))
                    boxes = np.delete(boxes, best, axis=0)
        self._objects = [
            item for item in self._objects if item.is_lasting or time - item.last <= _GAP
        ]
        new = (Box(*sides) for sides in boxes.tolist())
        self._objects += [_Object(time, time, box, box) for box in new]

    def findings(self) -> list[Finding]:
        """Return when weak detections lasted without a track."""
        lasting = [item for item in self._objects if item.is_lasting]
        seconds = {n for item in lasting for n in range(int(item.first), int(item.last) + 1)}
        if not seconds:
            return []
        spans = joined(sorted(seconds))
        text = (
            f"there may be an undetected vehicle ahead {when(spans)}: its detections score too low "
            "to be shown; check these times"
        )
        return [Finding("uncertain", text, tuple(spans))]


def _weak_boxes(picture: Picture, detections: Boxes, tracks: Sequence[Track]) -> Float64Array:
    """Return the boxes of weak detections, `(n, 4)`, without those of tracks.

    A box at the lower edge of the frame may be that of the camera's own vehicle, and is omitted.
    """
    sides = detections.sides
    rows = detections.scores >= _MIN_SCORE
    rows &= sides[:, 2] - sides[:, 0] >= _MIN_WIDTH * picture.width
    rows &= ~cut_sides(sides.T, (picture.width, picture.height)).bottom
    sides = sides[rows]
    shown = np.array([astuple(track.box) for track in tracks]).reshape(-1, 4)
    inside = np.maximum(coverage(sides, shown), coverage(shown, sides).T)
    return np.asarray(sides[inside.max(axis=1, initial=0) < _COVERED])
