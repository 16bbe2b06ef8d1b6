"""Lines and zones placed in frames, and the crossings of a whole path.

`vdet.traffic` explains the rule.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from vdet.boxes import BoolArray, Float64Array
from vdet.config.shapes import TrafficSettings
from vdet.polygons import Point, Segment, meeting, side_of, sides
from vdet.traffic.linking import DURATION_DIGITS, VehiclePath

ENTER, EXIT, APPEAR, VANISH = "enter", "exit", "appear", "vanish"
"""Directions of a zone: across its border, or first and last seen inside."""

_AT_EDGE = 0.002
"""A point within this fraction of the frame's side (or one pixel) of the frame's edge lies on it.
"""
_MAX_AT_EDGE = 0.005
"""Limit of that one pixel in small frames, as a fraction; lines are longer (`SHORTEST_LINE`)."""
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
class PlacedLine:
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
    def reach(self) -> Segment:
        """The line, extended where it ends at the edge of the frame: feet may be beyond it."""
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
        """Return the fraction of `path` at which it meets the line; None if it does not."""
        return meeting(path, self.reach)


@dataclass(frozen=True, slots=True)
class Zone:
    """A polygon, whose positive side is the inside; it extends beyond the edge of the frame.

    `corners` and `size`, the width and height of the frame, are in pixels.
    """

    name: str
    corners: tuple[Point, ...]
    size: _Size

    directions = ENTER, EXIT, APPEAR, VANISH

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


Border = PlacedLine | Zone
"""Its first direction leads to its positive side, its second to its negative side."""


def distances_to(segments: Sequence[Segment], points: Float64Array) -> Float64Array:
    """Return how far points `(n, 2)` are from the nearest points of segments `(m)`, `(n, m)`."""
    starts, ends = np.array(segments).swapaxes(0, 1)
    vectors, there = ends - starts, points[:, np.newaxis] - starts
    fractions = np.clip((there * vectors).sum(axis=2) / (vectors**2).sum(axis=1), 0, 1)
    return np.asarray(np.hypot(*np.moveaxis(there - fractions[..., np.newaxis] * vectors, 2, 0)))


def lines_near(
    lines: Sequence[PlacedLine], points: Float64Array, reach: Float64Array
) -> Iterator[PlacedLine]:
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


def place(
    settings: TrafficSettings, width: int, height: int
) -> tuple[tuple[PlacedLine, ...], tuple[Zone, ...]]:
    """Place lines and zones in frames of `width` × `height` pixels."""
    size, settings = (width, height), settings.for_frames(width, height)

    def placed(point: Point) -> Point:
        return _snapped(point[0], width), _snapped(point[1], height)

    lines = tuple(
        PlacedLine(line.name, (line.left, line.right), placed(line.start), placed(line.end), size)
        for line in settings.lines
    )
    zones = tuple(Zone(zone.name, tuple(map(placed, zone.points)), size) for zone in settings.zones)
    return lines, zones


def _snapped(value: float, length: float) -> float:
    """Return a coordinate, moved onto the edge of the frame if it is very near to it."""
    near = max(min(1.0, _MAX_AT_EDGE * length), _AT_EDGE * length)
    if value <= near:
        return 0.0
    return float(length) if length - value <= near else value


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
    found = list(_changes(path, border))
    if not isinstance(border, Zone) or not found:
        return found
    visits = found[:1]
    for before, item in pairwise(found):
        stay = item.time - before.time if item.direction == EXIT else None
        visits.append(replace(item, seconds=stay))
    last = path.seen - 1
    if found[-1].direction != EXIT:
        end = max(float(path.times[last]), found[-1].time)  # it may enter in extrapolated rows
        visits.append(Crossing(end, last, VANISH, end - found[-1].time))
    return visits


def _changes(path: VehiclePath, border: Border) -> Iterator[Crossing]:
    """Yield the changes of the settled side, and the start of a path inside a zone."""
    distances = border.distances(path.points)
    side = distances >= 0
    turns = (np.flatnonzero(side[1:] != side[:-1]) + 1).tolist()
    if not turns and not (side[0] and isinstance(border, Zone)):
        return  # as for most paths
    settles, is_clear = _settling(path, border, distances)
    settled: bool | None = None  # the side
    crossed: Point | None = None  # where it crossed last
    for row, end in pairwise([0, *turns, len(side)]):
        is_positive, rows = bool(side[row]), row + np.flatnonzero(settles[row:end])
        if not len(rows) or settled == is_positive:
            continue
        if settled is not None:
            fraction, time, place = _meeting(path, border, row)
            distance = math.inf if crossed is None else math.dist(crossed, place)
            if not (is_clear[rows] | (path.heights[rows] <= distance)).any():
                continue  # it is not far enough from there
            crossed = None if fraction is None else place
            if fraction is not None:
                at = row if fraction else row - 1
                yield Crossing(time, at, border.directions[1 - is_positive])
        elif is_positive and isinstance(border, Zone):
            yield Crossing(float(path.times[0]), 0, APPEAR)
        settled = is_positive


def _settling(
    path: VehiclePath, border: Border, distances: Float64Array
) -> tuple[BoolArray, BoolArray]:
    """Return the rows that settle a side, and those in which the side is clear.

    It is clear if this row or the previous one is one box height away from the border.
    """
    side, away, times = distances >= 0, np.abs(distances), path.times
    is_off = away > np.maximum(_BAND * path.heights, _MIN_BAND * border.size[1])
    is_far = is_off & (away >= path.heights)
    is_same = side[1:] == side[:-1]
    was_far = np.append(False, is_far[:-1] & is_same)
    begins = np.append(True, ~(is_off[1:] & is_off[:-1] & is_same))
    since = times[np.maximum.accumulate(np.where(begins, np.arange(len(times)), 0))]
    settles = was_far | (is_off & (np.round(times - since, DURATION_DIGITS) >= _SETTLED))
    settles[-1] |= is_far[-1]
    return settles, is_far | was_far


def _meeting(path: VehiclePath, border: Border, row: int) -> tuple[float | None, float, Point]:
    """Return where a path meets a border between a row and the previous one.

    Returns the fraction of the distance, None if they do not meet, and the time and position.
    """
    (ax, ay), (bx, by) = path.points[row - 1 : row + 1].tolist()
    before, after = path.times[row - 1 : row + 1].tolist()
    fraction = border.meeting(((ax, ay), (bx, by)))
    along = 1.0 if fraction is None else fraction
    place = ax + along * (bx - ax), ay + along * (by - ay)
    return fraction, before + along * (after - before), place
