"""Lines and zones in pixels of the frames, and the crossings of a whole path.

`vdet.traffic` explains the rule.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from vdet.boxes import EDGE, BoolArray, Float64Array
from vdet.config.scene import ZONE_DIRECTIONS, TrafficSettings
from vdet.polygons import Point, Segment, meeting, side_of, sides
from vdet.traffic.linking import DURATION_DIGITS, VehiclePath

ENTER, EXIT, APPEAR, VANISH = ZONE_DIRECTIONS

_INSIDE = 0.01
"""Points outside the frame are moved this far inside, pixels."""
_SETTLED = 0.1
"""Seconds outside the band of a border after which a vehicle has settled on a side."""
_BAND = 0.05
"""Distance from a border within which a vehicle is on neither side, in heights of its box."""
_MIN_BAND = 0.003
"""Minimum of this distance, as a fraction of the frame's height."""

_Size = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Line:
    """A line; its positive side is the left, seen from `start` towards `end`.

    `directions` are the names of left and right. `start` and `end` as drawn, and `size`, width and
    height of the frame, are in pixels.
    """

    name: str
    directions: tuple[str, str]
    start: Point
    end: Point
    size: _Size

    @property
    def length(self) -> float:
        """Pixels."""
        return math.dist(self.start, self.end)

    @property
    def extended(self) -> Segment:
        """The line, extended where it ends at the edge of the frame: vehicles stand beyond it."""
        (ax, ay), (bx, by) = self.start, self.end
        factor = sum(self.size) / self.length
        dx, dy = factor * (bx - ax), factor * (by - ay)
        start, end = (self._is_at_edge(point) for point in (self.start, self.end))
        return (ax - start * dx, ay - start * dy), (bx + end * dx, by + end * dy)

    def _is_at_edge(self, point: Point) -> bool:
        return any(value in (0, length) for value, length in zip(point, self.size, strict=True))

    def distances(self, points: Float64Array) -> Float64Array:
        """Return how far points `(n, 2)` are from the line, positive on the left, `(n,)`.

        The line is infinite here.
        """
        x, y = points.T
        return np.asarray(side_of(self.end, self.start, (x, y)))

    def meeting(self, path: Segment) -> float | None:
        """Return the fraction at which a path that changes the side meets the line.

        It follows from the distances that also give the side, so that none is lost by rounding.
        None if the path passes beyond the ends of the line.
        """
        before, after = self.distances(np.array(path)).tolist()
        along = before / (before - after)
        (ax, ay), (bx, by) = path
        (cx, cy), (dx, dy) = self.extended
        x, y = ax + along * (bx - ax) - cx, ay + along * (by - ay) - cy
        across = (x * (dx - cx) + y * (dy - cy)) / ((dx - cx) ** 2 + (dy - cy) ** 2)
        return along if 0 <= across <= 1 else None


@dataclass(frozen=True, slots=True)
class Zone:
    """A polygon, whose positive side is the inside; it extends beyond the edge of the frame.

    `corners` and `size`, the width and height of the frame, are in pixels.
    """

    name: str
    corners: tuple[Point, ...]
    size: _Size

    directions = ZONE_DIRECTIONS

    @property
    def inner_sides(self) -> list[Segment]:
        """The sides that do not run along the edge of the frame."""
        return [
            (a, b)
            for a, b in sides(self.corners)
            if not any(p == q and p in (0, end) for p, q, end in zip(a, b, self.size, strict=True))
        ]

    def distances(self, points: Float64Array) -> Float64Array:
        """Return how far points `(n, 2)` are from the sides, positive inside, `(n,)`.

        The distances are infinite if there are no sides.
        """
        points = self._in_frame(points)
        inside, border = _are_inside(self.corners, points), self.inner_sides
        if not border:
            return np.where(inside, np.inf, -np.inf)
        distances = distances_to(border, points).min(axis=1)
        return np.asarray(np.where(inside, distances, -distances))

    def meeting(self, path: Segment) -> float:
        """Return how far along `path` it last meets the border, 0 to 1."""
        (ax, ay), (bx, by) = self._in_frame(np.array(path)).tolist()
        fractions = (meeting(((ax, ay), (bx, by)), side) for side in self.inner_sides)
        return max((fraction for fraction in fractions if fraction is not None), default=1.0)

    def _in_frame(self, points: Float64Array) -> Float64Array:
        return np.clip(points, _INSIDE, np.array(self.size) - _INSIDE)


Border = Line | Zone
"""Its first direction leads to its positive side, its second to its negative side."""


def distances_to(segments: Sequence[Segment], points: Float64Array) -> Float64Array:
    """Return how far points `(n, 2)` are from the nearest points of segments `(m)`, `(n, m)`."""
    starts, ends = np.array(segments).swapaxes(0, 1)
    vectors, offsets = ends - starts, points[:, np.newaxis] - starts
    fractions = np.clip((offsets * vectors).sum(axis=2) / (vectors**2).sum(axis=1), 0, 1)
    return np.asarray(np.hypot(*np.moveaxis(offsets - fractions[..., np.newaxis] * vectors, 2, 0)))


def lines_near(lines: Sequence[Line], points: Float64Array, reach: Float64Array) -> Iterator[Line]:
    """Yield the lines that have one of the points `(n, 2)` within its reach, `(n,)`."""
    if lines:
        distances = distances_to([(line.start, line.end) for line in lines], points)
        are_near = (distances <= reach[:, np.newaxis]).T
        yield from (line for line, rows in zip(lines, are_near, strict=True) if rows.any())


def _are_inside(corners: Sequence[Point], points: Float64Array) -> BoolArray:
    """Return which points `(n, 2)` are inside a polygon; points on a side may be either.

    A point is inside if a ray from it meets an odd number of sides (Shimrat 1962).
    """
    x, y = points.T[..., np.newaxis]
    (ax, bx), (ay, by) = np.array(sides(corners)).T
    slopes = (bx - ax) / np.where(ay == by, 1, by - ay)
    met = ((ay > y) != (by > y)) & (x < ax + (y - ay) * slopes)
    return np.asarray(met.sum(axis=1) % 2 == 1)


def lines_and_zones(
    settings: TrafficSettings, width: int, height: int
) -> tuple[tuple[Line, ...], tuple[Zone, ...]]:
    """Return the lines and zones in frames of `width` × `height` pixels."""
    size, settings = (width, height), settings.for_frames(width, height)

    def in_frame(point: Point) -> Point:
        return _snapped(point[0], width), _snapped(point[1], height)

    lines = tuple(
        Line(line.name, (line.left, line.right), in_frame(line.start), in_frame(line.end), size)
        for line in settings.lines
    )
    zones = tuple(
        Zone(zone.name, tuple(map(in_frame, zone.points)), size) for zone in settings.zones
    )
    return lines, zones


def _snapped(value: float, length: float) -> float:
    """Return a coordinate, moved onto the edge of the frame if it is very near to it."""
    if value <= EDGE * length:
        return 0.0
    return float(length) if value >= length - EDGE * length else value


@dataclass(frozen=True, slots=True)
class Crossing:
    """A vehicle crosses a line, or enters, leaves, appears in or vanishes from a zone.

    Attributes
    ----------
    time
        Seconds, interpolated between two rows of the path.
    row
        Number of the first row of the path at or after it.
    direction
        As in `Event`.
    seconds
        How long the vehicle was in the zone, for exit and vanish; else None.
    """

    time: float
    row: int
    direction: str
    seconds: float | None = None


def crossings(path: VehiclePath, border: Border) -> list[Crossing]:
    """Return the crossings of a border by a vehicle, in order; a pure function."""
    changes = list(_changes(path, border))
    if not isinstance(border, Zone) or not changes:
        return changes
    visits = changes[:1]
    for entry, change in pairwise(changes):
        stay = change.time - entry.time if change.direction == EXIT else None
        visits.append(replace(change, seconds=stay))
    entry, last = changes[-1], path.seen - 1
    if entry.direction != EXIT:
        end = max(float(path.times[last]), entry.time)  # it may enter in extrapolated rows
        visits.append(Crossing(end, last, VANISH, end - entry.time))
    return visits


@dataclass(frozen=True, slots=True, eq=False)
class _SideRun:
    """Consecutive rows of a path on one side of a border, from row `start`.

    `height` is the minimum height of the box, pixels, of the rows in which the vehicle settles;
    `is_clear` says whether it is clearly on this side in one of them.
    """

    start: int
    is_positive: bool
    height: float
    is_clear: bool


def _changes(path: VehiclePath, border: Border) -> Iterator[Crossing]:
    """Yield the changes of the settled side, and the start of a path inside a zone."""
    is_positive: bool | None = None  # the settled side
    latest: Point | None = None  # of the latest crossing, unless it was beyond the line's ends
    for run in _runs(path, border):
        if is_positive is None:
            is_positive = run.is_positive
            if is_positive and isinstance(border, Zone):
                yield Crossing(float(path.times[0]), 0, APPEAR)
        elif run.is_positive != is_positive:
            point = _border_point(path, border, run.start)
            distance = math.dist(latest, point.position) if latest else math.inf
            if run.is_clear or run.height <= distance:  # else it is still near the latest crossing
                is_positive, latest = run.is_positive, None
                if point.is_on_border:
                    latest, direction = point.position, border.directions[0 if is_positive else 1]
                    yield Crossing(point.time, point.row, direction)


def _runs(path: VehiclePath, border: Border) -> Iterator[_SideRun]:
    """Yield the runs in which the vehicle settles; none if it stays on one side, except inside."""
    distances = border.distances(path.points)
    is_positive = distances >= 0
    turns = (np.flatnonzero(is_positive[1:] != is_positive[:-1]) + 1).tolist()
    if not turns and not (is_positive[0] and isinstance(border, Zone)):
        return  # as for most paths
    settles, is_clear = _settling(path, border, distances)
    for start, end in pairwise([0, *turns, len(is_positive)]):
        rows = start + np.flatnonzero(settles[start:end])
        if len(rows):
            yield _SideRun(
                start,
                is_positive=bool(is_positive[start]),
                height=float(path.heights[rows].min()),
                is_clear=bool(is_clear[rows].any()),
            )


def _settling(
    path: VehiclePath, border: Border, distances: Float64Array
) -> tuple[BoolArray, BoolArray]:
    """Return the rows in which a vehicle settles on its side, and those in which that is clear.

    It is clear if this row or the previous one is one box height away from the border. Otherwise
    the vehicle settles after some time outside the band.
    """
    is_positive, away, times = distances >= 0, np.abs(distances), path.times
    is_outside = away > np.maximum(_BAND * path.heights, _MIN_BAND * border.size[1])
    is_far = is_outside & (away >= path.heights)
    stays = is_positive[1:] == is_positive[:-1]
    was_far = np.append(False, is_far[:-1] & stays)
    begins = np.append(True, ~(is_outside[1:] & is_outside[:-1] & stays))
    since = times[np.maximum.accumulate(np.where(begins, np.arange(len(times)), 0))]
    settles = was_far | (is_outside & (np.round(times - since, DURATION_DIGITS) >= _SETTLED))
    settles[-1] |= is_far[-1]
    return settles, is_far | was_far


@dataclass(frozen=True, slots=True)
class _BorderPoint:
    """Where a path passes a border: time in seconds, first row at or after it, and position.

    `is_on_border` says whether it meets the line between its ends.
    """

    time: float
    row: int
    position: Point
    is_on_border: bool


def _border_point(path: VehiclePath, border: Border, row: int) -> _BorderPoint:
    """Return where a path passes a border between the previous row and this one."""
    (ax, ay), (bx, by) = path.points[row - 1 : row + 1].tolist()
    before, after = path.times[row - 1 : row + 1].tolist()
    fraction = border.meeting(((ax, ay), (bx, by)))
    along = 1.0 if fraction is None else fraction
    return _BorderPoint(
        time=before + along * (after - before),
        row=row if along else row - 1,
        position=(ax + along * (bx - ax), ay + along * (by - ay)),
        is_on_border=fraction is not None,
    )
