"""Moving objects in front of a fixed camera that are not detected vehicles.

The background is a running median of the planes (McFarlane and Schofield 1995). Areas that differ
from it, outside the boxes, are linked from plane to plane. Only objects that travel count, not
leaves, flags or water on the lens. They count as vehicles if they are compact, not upright as
people are, and have sharp edges, unlike rain, clouds and reflections.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np

from vdet.boxes import Box, Float32Array, Float64Array, Image
from vdet.errors import quantity
from vdet.findings import Finding
from vdet.polygons import Point, Segment, meeting
from vdet.traffic.clock import Span, extend, when

_RATE = 8.0
"""Grey levels per second by which the background adapts."""
_NOISE, _CONTRAST, _SPREAD = 4.0, 12.0, 0.35
"""Minimum difference: in usual differences of a pixel, and in grey levels. Until something is
tracked, it is a fraction of the standard deviation of the plane, which is small in the dark and in
fog, but at least a third of these levels.
"""
_MIN_AREA, _MAX_AREA = 0.0015, 0.25
"""Area of a mover, fractions of the frame's; more is a cloud, or a change of the light."""
_MAX_AREAS = 60
"""Number of areas that differ, of any size: more are rain or snow."""
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
_COMPACT, _WIDE, _SHARP = 0.5, 0.7, 0.65
"""Means of a vehicle: part of its bounding box that differs, width per height of that, and steepest
change of the difference from pixel to pixel, as a fraction of the largest difference.
"""
_SLOW = 0.2
"""Minimum speed of a vehicle, in its sizes per second."""
_MIN_MOVERS, _MIN_FRACTION = 2, 0.15
"""Minimum number of movers, and minimum fraction of all that travelled, for a finding."""
_GAP = 2.0
"""Maximum seconds between movers of one span."""
_FORGOTTEN = 10.0
"""Seconds after which the start of a track is forgotten."""


@dataclass(frozen=True, slots=True)
class _Area:
    """A moving area of a plane: its centre, its larger side, and its shape: see `_COMPACT`."""

    center: Point
    size: float
    shape: tuple[float, float, float]


@dataclass(slots=True, eq=False)
class Mover:
    """A moving object, from its first area to its last.

    `is_detected` says whether it came out of the box of a vehicle, or was detected later.
    """

    is_detected: bool
    start: Point
    first: float
    last: float = 0.0
    point: Point = (0.0, 0.0)
    size: float = 0.0
    length: float = 0.0
    planes: int = 0
    shapes: Float64Array = field(default_factory=lambda: np.zeros(3))  # sum over its planes
    crossed: set[str] = field(default_factory=set)

    def has_travelled(self, width: int) -> bool:
        """Return whether it travelled, in planes of this width."""
        minimum = max(_TRAVEL * width, self.size, _STRAIGHT * self.length)
        return self.planes >= _PLANES and math.dist(self.start, self.point) >= minimum

    @property
    def is_vehicle(self) -> bool:
        """Whether it has the shape and the speed of a vehicle."""
        is_shaped = self.shapes / self.planes >= (_COMPACT, _WIDE, _SHARP)
        far = math.dist(self.start, self.point)
        return bool(is_shaped.all()) and far >= _SLOW * self.size * (self.last - self.first)


class MotionWatch:
    """Tracks moving objects through the planes of one video.

    `lines` are places that they may cross, fractions of the frame, by their names.
    """

    def __init__(self, lines: Mapping[str, Segment]) -> None:
        self._lines = lines
        self._missed = self._others = self._tracked = self._travelled = 0
        self._crossed: Counter[str] = Counter()
        self._spans: list[Span] = []
        self._movers: list[Mover] = []
        self._starts: dict[int, tuple[Point, float, bool]] = {}
        """Where each track was first seen, when it was last seen, and whether it travelled."""
        self._background = self._usual = np.empty((0, 0), np.float32)
        self._covered = np.empty((0, 0), np.uint8)
        self._time = 0.0

    def add(self, time: float, plane: Image, boxes: Mapping[int, Box], *, is_steady: bool) -> None:
        """Add the next plane, uint8 `(h, w)`; `boxes` are those of vehicles by id, its pixels.

        `is_steady` says whether the camera has not moved since the previous plane.
        """
        follow, self._time = np.float32(min(1.0, time - self._time) * _RATE), time
        before, self._covered = self._covered, np.zeros_like(plane)
        self._see(time, boxes)
        if not is_steady or not self._background.size:
            self._background, self._movers = plane.astype(np.float32), []
            self._usual = np.full(plane.shape, _CONTRAST / _NOISE, np.float32)
            return
        difference = plane - self._background
        difference -= np.median(difference[::2, ::2])
        size = np.abs(difference)
        spread = np.inf if self._tracked else self._background[::2, ::2].std()
        contrast = np.clip(_SPREAD * spread, _CONTRAST / 3, _CONTRAST)
        differs = size > np.maximum(contrast, _NOISE * self._usual)
        self._background += np.clip(difference, -follow, follow)
        self._usual += np.clip(size - self._usual, -follow / 8, follow / 8)
        self._link(time, list(self._areas(differs.astype(np.uint8), size)), before)

    def _see(self, time: float, boxes: Mapping[int, Box]) -> None:
        """Mark the boxes of vehicles, and count those that drive."""
        for number, box in boxes.items():
            box.cut(self._covered)[:] = 1
            self._tracked += number not in self._starts
            start, _, travelled = self._starts.get(number, (box.center, time, False))
            far = math.dist(start, box.center) >= _TRAVEL * self._covered.shape[1]
            self._travelled += far and not travelled
            self._starts[number] = start, time, far or travelled
        if len(self._starts) > len(boxes):
            oldest = time - _FORGOTTEN
            self._starts = {key: seen for key, seen in self._starts.items() if seen[1] >= oldest}

    def restart(self) -> None:
        """Take the next plane for the background."""
        self._end(self._movers)
        self._movers, self._background = [], np.empty((0, 0), np.float32)

    def findings(self) -> list[Finding]:
        """Return what travelled and was not found: how much of it, and when."""
        self._end(self._movers)
        self._movers = []
        if not self._tracked:
            return self._nothing_found()
        fraction = self._missed / max(1, self._missed + self._travelled)
        if self._missed < _MIN_MOVERS or fraction < _MIN_FRACTION:
            return []
        text = (
            f"{fraction:.0%} of the moving objects are not detected as vehicles, mostly "
            f"{when(self._spans)}: visibility is poor, or the detector lacks their classes"
        )
        return [Finding("unexplained-motion", text, tuple(self._spans), value=fraction)]

    def _nothing_found(self) -> list[Finding]:
        """Return the finding about a video without a single track."""
        if self._missed:
            places = "".join(f", {number} across {name}" for name, number in self._crossed.items())
            text = (
                f"no vehicle was found, but at least {quantity(self._missed, 'thing')} moved here"
                f"{places}, mostly {when(self._spans)}: do not trust a count of 0"
            )
            return [Finding("nothing-found", text, tuple(self._spans), value=float(self._missed))]
        text = "no vehicle was found, and nothing moved"
        if self._others:
            text = "no vehicle was found; what moved here does not look like one"
        return [Finding("nothing-found", text, severity="note")]

    def _link(self, time: float, areas: list[_Area], before: Image) -> None:
        """Link the movers; `before` marks the boxes of the previous plane."""
        lost, self._movers = self._movers, []
        for area in areas:
            mover = min(lost, key=lambda item: math.dist(item.point, area.center), default=None)
            if mover and math.dist(mover.point, area.center) < _REACH * area.size:
                lost.remove(mover)
                mover.length += math.dist(mover.point, area.center)
                mover.crossed |= self._crossed_by((mover.point, area.center))
            else:
                mover = Mover(_is_in(area.center, before), area.center, time)
            mover.last, mover.point, mover.size = time, area.center, area.size
            mover.planes += 1
            mover.shapes += area.shape
            self._movers.append(mover)
        for mover in lost:
            mover.is_detected |= _is_in(mover.point, self._covered)
        self._end(lost)

    def _crossed_by(self, step: Segment) -> set[str]:
        """Return the names of the lines that a step in a plane crosses."""
        height, width = self._covered.shape
        (ax, ay), (bx, by) = step
        part = (ax / width, ay / height), (bx / width, by / height)
        return {name for name, line in self._lines.items() if meeting(part, line) is not None}

    def _end(self, movers: Iterable[Mover]) -> None:
        """Count the movers that travelled and were not detected."""
        for mover in movers:
            if not mover.is_detected and mover.has_travelled(self._covered.shape[1]):
                if not mover.is_vehicle:
                    self._others += 1
                    continue
                self._missed += 1
                self._crossed.update(mover.crossed)
                end = max([mover.last, *(last for _, last in self._spans[-1:])])
                extend(self._spans, mover.first, _GAP)
                extend(self._spans, end, math.inf)

    def _areas(self, differs: Image, difference: Float32Array) -> Iterator[_Area]:
        """Yield the areas that differ outside the boxes, the largest first."""
        closed = cv2.morphologyEx(differs, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        count, labels, stats, _ = cv2.connectedComponentsWithStats(closed)
        if count > _MAX_AREAS:
            return
        labels[self._covered > 0] = 0
        areas = stats[:, cv2.CC_STAT_AREA]
        minimum, maximum = _MIN_AREA * differs.size, _MAX_AREA * differs.size
        for number in np.argsort(-areas).tolist():
            if number and minimum <= areas[number] <= maximum:
                left, top, width, height = stats[number, :4].tolist()
                x, y = max(0, left - 1), max(0, top - 1)  # with the edge of the background
                part = np.s_[y : top + height + 1, x : left + width + 1]
                rows, columns = np.nonzero(labels[part] == number)
                if len(rows) >= max(_OUTSIDE * areas[number], minimum):
                    shown = difference[part]
                    steepest = max(np.abs(np.diff(shown, axis=axis)).max() for axis in (0, 1))
                    compact, sharp = len(rows) / (width * height), float(steepest / shown.max())
                    center = x + float(columns.mean()), y + float(rows.mean())
                    shape = compact, width / height, sharp
                    yield _Area(center, float(max(width, height)), shape)


def _is_in(point: Point, covered: Image) -> bool:
    return bool(covered[int(point[1]), int(point[0])])
