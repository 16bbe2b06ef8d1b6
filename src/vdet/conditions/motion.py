"""What moved and was not detected: before a fixed camera, and before a moving one.

Before a fixed camera, these are moving objects that are not detected vehicles (`MotionWatch`). The
background is a running median of the planes (McFarlane and Schofield 1995). Areas that differ from
it, outside the boxes, are linked from plane to plane. Only objects that travel count, not leaves,
flags or water on the lens. They count as vehicles if they are compact, not upright as people are,
and have sharp edges, unlike rain, clouds and reflections.

Before a moving camera, they are weak detections that stay in view: possibly a vehicle ahead
(`WeakWatch`). Objects beside the road leave the view, false detections in single frames do not
last, and dirt on the glass does not move in the frame. Before a fixed camera signs and buildings
last, so this is not for fixed cameras.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field

import cv2
import numpy as np

from vdet.boxes import (
    Box,
    Boxes,
    Float32Array,
    Float64Array,
    Image,
    coverage,
    cut_sides,
    has_moved,
    iou_matrix,
)
from vdet.errors import quantity
from vdet.findings import Finding
from vdet.media import Picture
from vdet.polygons import Point, Segment, meeting
from vdet.track.track import Track
from vdet.traffic.clock import GAP, Span, extend, joined, when

# These limits were set by hand on three real clips of fixed cameras, 41 s. Without a detector, 15
# moving objects count there as vehicles; with its tracks, none. The comments say how many do with
# half and with twice of a limit, where that is not 15 and none.

_RATE = 8.0
"""Grey levels per second by which the background adapts. Half: 16. Twice: 13."""
_NOISE, _CONTRAST, _SPREAD = 4.0, 12.0, 0.35
"""Minimum difference: in usual differences of a pixel, and in grey levels. Until something is
tracked, it is a fraction of the standard deviation of the plane, which is small in the dark and in
fog, but at least a third of these levels. Half of each: 9, 8, 10. Twice: 15, 13, 15.
"""
_MIN_AREA, _MAX_AREA = 0.0015, 0.25
"""Area of a mover, fractions of the frame's; more is a cloud, or a change of the light. Half of the
first: 15, and one in spite of its track. Twice: 13.
"""
_MAX_AREAS = 60
"""Number of areas that differ, of any size: more are rain or snow."""
_OUTSIDE = 0.5
"""Minimum fraction of it outside the boxes; less is a shadow, or the edge of a vehicle."""
_TRAVEL = 0.08
"""Minimum distance from the start of an object that travels, as a fraction of the frame's width.
Half: 17. Twice: 12.
"""
_STRAIGHT = 0.7
"""The same, as a fraction of the length of its path. Half: 15, and two more, not like vehicles."""
_PLANES = 4
"""Minimum number of planes that show it. Twice: 14."""
_REACH = 1.5
"""Maximum distance to the next plane, as a multiple of its size. Half: 14. Twice: 13."""
_COMPACT, _WIDE, _SHARP = 0.5, 0.7, 0.65
"""Means of a vehicle: part of its bounding box that differs, width per height of that, and steepest
change of the difference from pixel to pixel, as a fraction of the largest difference. Half of each:
16, and one in spite of its track; 16; 15. Twice: 0, 5, 0.
"""
_SLOW = 0.2
"""Minimum speed of a vehicle, in its sizes per second. Half: 16."""
_MIN_MOVERS, _MIN_FRACTION = 2, 0.15
"""Minimum number of movers, and minimum fraction of all that travelled, for a finding."""
_FAR = 0.25
"""Minimum distance of a single mover for a finding where nothing is tracked, as a fraction of the
frame's width. In 5 of 80 drawn clips of trees, a single branch moved, by at most 0.19.
"""
_FORGOTTEN = 10.0
"""Seconds after which the start of a track is forgotten."""

# The limits of weak detections were set by hand. Half and twice of each change no finding of four
# real clips, 49 s, but where they say so.

_MIN_SCORE = 0.1
"""Minimum score of a detection."""
_MIN_WIDTH = 0.04
"""Minimum width of a detection, as a fraction of the frame's: smaller ones are too frequent."""
_COVERED = 0.5
"""A detection belongs to a track if more than this fraction of the detection is in the box of the
track, or of that box in the detection. If none did, a real clip would get a false finding.
"""
_SAME_IOU, _UNSEEN = 0.4, 0.5
"""Minimum overlap of consecutive detections of one object, and the maximum seconds between them."""
_SHORTEST = 3.0
"""Minimum seconds between the first and the last detection of an object."""


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

    @property
    def distance(self) -> float:
        """Distance from its start, pixels."""
        return math.dist(self.start, self.point)

    def has_travelled(self, width: int) -> bool:
        """Return whether it travelled, in planes of this width."""
        minimum = max(_TRAVEL * width, self.size, _STRAIGHT * self.length)
        return self.planes >= _PLANES and self.distance >= minimum

    @property
    def is_vehicle(self) -> bool:
        """Whether it has the shape and the speed of a vehicle."""
        is_shaped = self.shapes / self.planes >= (_COMPACT, _WIDE, _SHARP)
        is_fast = self.distance >= _SLOW * self.size * (self.last - self.first)
        return bool(is_shaped.all()) and is_fast


class MotionWatch:
    """Tracks moving objects through the planes of one video.

    `lines` are places that they may cross, fractions of the frame, by their names.
    """

    def __init__(self, lines: Mapping[str, Segment]) -> None:
        self._lines = lines
        self._missed = self._others = self._tracked = self._travelled = 0
        self._farthest = 0.0  # fraction of the width
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
        if self._missed >= _MIN_MOVERS or self._farthest >= _FAR:
            places = "".join(f", {number} across {name}" for name, number in self._crossed.items())
            text = (
                f"no vehicle was found, but at least {quantity(self._missed, 'thing')} moved here"
                f"{places}, mostly {when(self._spans)}: do not trust a count of 0"
            )
            return [Finding("nothing-found", text, tuple(self._spans), value=float(self._missed))]
        text = "no vehicle was found, and nothing moved"
        if self._missed:
            text = f"no vehicle was found; one thing moved, but not far, {when(self._spans)}"
        elif self._others:
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
        width = self._covered.shape[1]
        for mover in movers:
            if not mover.is_detected and mover.has_travelled(width):
                if not mover.is_vehicle:
                    self._others += 1
                    continue
                self._missed += 1
                self._farthest = max(self._farthest, mover.distance / width)
                self._crossed.update(mover.crossed)
                end = max([mover.last, *(last for _, last in self._spans[-1:])])
                extend(self._spans, mover.first, GAP)
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
            if len(boxes) and time - item.last <= _UNSEEN:
                overlaps = iou_matrix(np.array([astuple(item.box)]), boxes)[0]
                best = int(overlaps.argmax())
                if overlaps[best] >= _SAME_IOU:
                    item.add(time, Box(*boxes[best].tolist()))
                    boxes = np.delete(boxes, best, axis=0)
        self._objects = [
            item for item in self._objects if item.is_lasting or time - item.last <= _UNSEEN
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
