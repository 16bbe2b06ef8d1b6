"""Moving objects in front of a fixed camera that are not detected vehicles.

The background is a running median of the planes (McFarlane and Schofield 1995). Areas that differ
from it, outside the boxes, are linked from plane to plane. Only objects that travel count, not
leaves, flags or water on the lens.
"""

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np

from vdet.boxes import Box, Image
from vdet.findings import Finding
from vdet.polygons import Point
from vdet.traffic.clock import joined, when

_RATE = 8.0
"""Grey levels per second by which the background adapts."""
_NOISE, _CONTRAST = 4.0, 12.0
"""Minimum difference: in usual differences of a pixel, and in grey levels."""
_MIN_AREA, _MAX_AREA = 0.0015, 0.25
"""Area of a mover, fractions of the frame's; more is a cloud, or a change of the light."""
_OUTSIDE = 0.5
"""Minimum fraction of it outside the boxes; less is a shadow, or the edge of a vehicle."""
_TRAVEL = 0.08
"""Minimum distance from the start of an object that travels, as a fraction of the frame's width."""
_STRAIGHT = 0.7
"""The same, as a fraction of the length of its path."""
_PLANES = 4
"""Minimum number of planes that show it."""
_REACH = 1.5
"""Maximum distance to the next plane, as a multiple of its size."""
_MIN_MOVERS, _MIN_FRACTION = 2, 0.15
"""Minimum number of movers, and minimum fraction of all that travelled, for a finding."""


@dataclass(slots=True, eq=False)
class Mover:
    """A moving object: its times, positions (pixels of a plane) and last size.

    `is_detected` says whether it came out of the box of a vehicle, or was detected later.
    """

    is_detected: bool
    size: float = 0.0
    times: list[float] = field(default_factory=list)
    points: list[Point] = field(default_factory=list)

    def has_travelled(self, width: int) -> bool:
        """Return whether it travelled, in planes of this width."""
        length = sum(map(math.dist, self.points, self.points[1:]))
        minimum = max(_TRAVEL * width, self.size, _STRAIGHT * length)
        return len(self.points) >= _PLANES and math.dist(self.points[0], self.points[-1]) >= minimum


class MotionWatch:
    """Tracks moving objects through the planes of one video."""

    def __init__(self) -> None:
        self._ended: list[list[float]] = []
        self._movers: list[Mover] = []
        self._starts: dict[int, Point] = {}
        self._travelled: set[int] = set()
        self._background = self._usual = np.empty((0, 0), np.float32)
        self._covered = np.empty((0, 0), np.uint8)
        self._time = 0.0

    def add(self, time: float, plane: Image, boxes: Mapping[int, Box], *, is_steady: bool) -> None:
        """Add the next plane, uint8 `(h, w)`; `boxes` are those of vehicles by id, its pixels.

        `is_steady` says whether the camera has not moved since the previous plane.
        """
        follow, self._time = np.float32(min(1.0, time - self._time) * _RATE), time
        before, self._covered = self._covered, np.zeros_like(plane)
        for number, box in boxes.items():
            box.cut(self._covered)[:] = 1
            start = self._starts.setdefault(number, box.center)
            if math.dist(start, box.center) >= _TRAVEL * plane.shape[1]:
                self._travelled.add(number)
        if not is_steady or not self._background.size:
            self._background, self._movers = plane.astype(np.float32), []
            self._usual = np.full(plane.shape, _CONTRAST / _NOISE, np.float32)
            return
        difference = plane - self._background
        difference -= np.median(difference[::2, ::2])
        size = np.abs(difference)
        differs = size > np.maximum(_CONTRAST, _NOISE * self._usual)
        self._background += np.clip(difference, -follow, follow)
        self._usual += np.clip(size - self._usual, -follow / 8, follow / 8)
        self._link(time, differs.astype(np.uint8), before)

    def findings(self) -> list[Finding]:
        """Return the fraction of travelling objects that are not detected vehicles, and when."""
        undetected = self._ended + self._undetected(self._movers)
        fraction = len(undetected) / max(1, len(undetected) + len(self._travelled))
        if len(undetected) < _MIN_MOVERS or fraction < _MIN_FRACTION:
            return []
        spans = joined(sorted(itertools.chain.from_iterable(undetected)))
        text = (
            f"{fraction:.0%} of the moving objects are not detected as vehicles, mostly "
            f"{when(spans)}: visibility is poor, or the detector lacks their classes"
        )
        return [Finding("unexplained-motion", text, tuple(spans), value=fraction)]

    def _link(self, time: float, differs: Image, before: Image) -> None:
        """Link the movers; `before` marks the boxes of the previous plane."""
        lost, self._movers = self._movers, []
        for center, size in self._moving_areas(differs):
            mover = min(lost, key=lambda item: math.dist(item.points[-1], center), default=None)
            if mover and math.dist(mover.points[-1], center) < _REACH * size:
                lost.remove(mover)
            else:
                mover = Mover(_is_in(center, before))
            mover.size = size
            mover.times.append(time)
            mover.points.append(center)
            self._movers.append(mover)
        for mover in lost:
            mover.is_detected |= _is_in(mover.points[-1], self._covered)
        self._ended += self._undetected(lost)

    def _undetected(self, movers: Iterable[Mover]) -> list[list[float]]:
        """Return the times of each mover that travelled and was not detected."""
        width = self._covered.shape[1]
        return [item.times for item in movers if not item.is_detected and item.has_travelled(width)]

    def _moving_areas(self, differs: Image) -> list[tuple[Point, float]]:
        """Return centre and size of the areas that differ outside the boxes, the largest first."""
        closed = cv2.morphologyEx(differs, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        _, labels, stats, _ = cv2.connectedComponentsWithStats(closed)
        labels[self._covered > 0] = 0
        areas = stats[:, cv2.CC_STAT_AREA]
        minimum, maximum = _MIN_AREA * differs.size, _MAX_AREA * differs.size
        moving = []
        for number in np.argsort(-areas).tolist():
            if number and minimum <= areas[number] <= maximum:
                rows, columns = np.nonzero(labels == number)
                if len(rows) >= max(_OUTSIDE * areas[number], minimum):
                    center = float(columns.mean()), float(rows.mean())
                    moving.append((center, float(max(np.ptp(rows), np.ptp(columns)) + 1)))
        return moving


def _is_in(point: Point, covered: Image) -> bool:
    return bool(covered[int(point[1]), int(point[0])])
