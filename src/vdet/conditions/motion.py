"""What moves before a still camera, and whether a vehicle that was found explains it.

The background follows the planes as a running median (McFarlane and Schofield 1995). What differs
from it is linked from plane to plane. Only what travels counts: leaves, flags and drops do not.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from vdet.boxes import Box, Float32Array, Image
from vdet.conditions.finding import Finding, joined, when
from vdet.polygons import Point

_RATE = 8.0
"""Grey levels by which the background follows in a second."""
_NOISE = 4.0
"""What differs does so by this many times the usual difference of a pixel…"""
_CONTRAST = 12.0
"""… and by this many grey levels."""
_SMALLEST = 0.03, 0.0015
"""Width and area of what counts, as fractions of the frame's."""
_LARGEST = 0.25
"""Of the frame's area; more is a cloud, or a change of the light."""
_COVERED = 0.2
"""Fraction of a thing that lies in boxes, from which they explain it."""
_EXPLAINED = 0.3
"""Fraction of its planes in which boxes explain a thing that is explained."""
_TRAVEL = 0.08
"""Way of a thing that travels, as a fraction of the frame's width."""
_STRAIGHT = 0.7
"""Its distance from where it began, as a fraction of its way."""
_PLANES = 4
"""Number of planes that show a thing that travels."""
_REACH = 1.5
"""How far a thing moves to the next plane, as a multiple of its size."""
_FEWEST, _FRACTION = 2, 0.15
"""Number of things, and fraction of all that travelled, from which a finding is reported."""
_GAP = 5.0
"""Seconds between two of them that end a span."""


@dataclass(slots=True)
class Mover:
    """A thing that moved: when it was seen first and last, and in how many planes boxes explain it.

    Its places, size and way are pixels of the planes, which are `width` pixels wide.
    """

    width: int
    first: float
    start: Point
    place: Point
    last: float = 0.0
    size: float = 0.0
    planes: int = 0
    covered: int = 0
    way: float = 0.0

    def add(self, time: float, place: Point, size: float, *, is_covered: bool) -> None:
        """Add the next plane that shows it."""
        self.way += math.dist(self.place, place)
        self.place, self.last, self.size = place, time, size
        self.planes += 1
        self.covered += is_covered

    @property
    def is_explained(self) -> bool:
        """Whether a vehicle that was found explains it."""
        return self.covered >= _EXPLAINED * self.planes

    @property
    def has_travelled(self) -> bool:
        """Whether it moved on."""
        net = math.dist(self.start, self.place)
        least = max(_TRAVEL * self.width, self.size, _STRAIGHT * self.way)
        return self.planes >= _PLANES and net >= least


@dataclass(slots=True)
class MotionWatch:
    """Follows what moves through the planes of one video."""

    _ended: list[Mover] = field(default_factory=list)
    _movers: list[Mover] = field(default_factory=list)
    _background: Float32Array | None = None
    _usual: Float32Array | None = None
    _time: float = 0.0

    def reset(self) -> None:
        """Begin anew: the camera has moved."""
        self._background, self._movers = None, []

    def add(self, time: float, plane: Image, boxes: Sequence[Box]) -> None:
        """Add the next plane, uint8 `(h, w)`; `boxes` are those of vehicles, in its pixels."""
        step, self._time = time - self._time, time
        if self._background is None or self._usual is None:
            self._background = plane.astype(np.float32)
            self._usual = np.full(plane.shape, _CONTRAST / _NOISE, np.float32)
            return
        difference = plane - self._background
        difference -= np.median(difference[::2, ::2])
        size = np.abs(difference)
        differs = size > np.maximum(_CONTRAST, _NOISE * self._usual)
        follow = np.float32(min(1.0, step) * _RATE)
        self._background += np.clip(difference, -follow, follow)
        self._usual += np.clip(size - self._usual, -follow / 8, follow / 8)
        self._link(time, differs.astype(np.uint8), boxes)

    def findings(self) -> list[Finding]:
        """Return how much of what travelled no box explains, and when."""
        travelled = self._ended + [each for each in self._movers if each.has_travelled]
        left = [each for each in travelled if not each.is_explained]
        fraction = len(left) / max(1, len(travelled))
        if len(left) < _FEWEST or fraction < _FRACTION:
            return []
        times = sorted(time for each in left for time in (each.first, each.last))
        spans = joined(times, _GAP)
        text = (
            f"{fraction:.0%} of what moved is not explained by a vehicle that was found, most of "
            f"it {when(spans)}: it is hard to see, or of a kind that the detector does not look for"
        )
        return [Finding("unexplained-motion", text, tuple(spans), value=fraction)]

    def _link(self, time: float, differs: Image, boxes: Sequence[Box]) -> None:
        width = differs.shape[1]
        covered = np.zeros_like(differs)
        for box in boxes:
            box.cut(covered)[:] = 1
        joined = cv2.morphologyEx(differs, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        _, labels, stats, centers = cv2.connectedComponentsWithStats(joined)
        left, going = list(self._movers), []
        for number in np.argsort(-stats[1:, cv2.CC_STAT_AREA]) + 1:
            x, y, w, h, area = stats[number].tolist()
            if w < _SMALLEST[0] * width or not _SMALLEST[1] <= area / differs.size <= _LARGEST:
                continue
            part = np.s_[y : y + h, x : x + w]
            is_covered = covered[part][labels[part] == number].mean() >= _COVERED
            center = float(centers[number][0]), float(centers[number][1])
            mover = min(left, key=lambda each: math.dist(each.place, center), default=None)
            if mover and math.dist(mover.place, center) < _REACH * max(w, h):
                left.remove(mover)
            else:
                mover = Mover(width, time, center, center)
            mover.add(time, center, max(w, h), is_covered=bool(is_covered))
            going.append(mover)
        self._ended += [each for each in left if each.has_travelled]
        self._movers = going
