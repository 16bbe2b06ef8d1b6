"""Lines and zones in pixels of the frames of one video."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import BoolArray, Float64Array
from vdet.config.places import TrafficSettings
from vdet.polygons import Point, Segment, meeting, side_of, sides

ENTER, EXIT, APPEAR, VANISH = "enter", "exit", "appear", "vanish"
"""Directions of a zone: over its border, or first and last seen inside."""

_AT_EDGE = 0.002
"""A point within this fraction of the frame's side (or one pixel) of the frame's edge lies on it.
"""
_MOST_AT_EDGE = 0.005
"""Limit of that one pixel in small frames, as a share; lines are longer (`SHORTEST_LINE`)."""
_INSIDE = 0.01
"""Pixels from the edge of the frame to which points outside are moved."""

_Size = tuple[float, float]


@dataclass(frozen=True, slots=True)
class PlacedLine:
    """A line; its positive side is the left of someone who looks from `start` to `end`.

    `directions` are the names of the left and of the right. `start` and `end` are those that are
    drawn; `reach` goes on where they lie at the edge of the frame. `size` is the width and height
    of the frame. All are in pixels.
    """

    name: str
    directions: tuple[str, str]
    start: Point
    end: Point
    reach: Segment
    size: _Size

    @property
    def length(self) -> float:
        """Pixels."""
        return math.dist(self.start, self.end)

    def distances(self, points: Float64Array) -> Float64Array:
        """Return how far points `(n, 2)` are from the line, positive on the left, `(n,)`.

        The line goes on beyond its ends.
        """
        x, y = points.T
        return np.asarray(side_of(self.end, self.start, (x, y)))

    def meeting(self, path: Segment) -> float | None:
        """Return the fraction of the way along `path` at which it meets the line, if it does."""
        return meeting(path, self.reach)


@dataclass(frozen=True, slots=True)
class Zone:
    """A polygon, whose positive side is the inside; at the frame's edge it goes on beyond.

    `sides` are those of its sides that do not run along the edge of the frame, `size` is the width
    and height of the frame. All are in pixels.
    """

    name: str
    corners: tuple[Point, ...]
    sides: tuple[Segment, ...]
    size: _Size

    directions = ENTER, EXIT, APPEAR, VANISH

    def distances(self, points: Float64Array) -> Float64Array:
        """Return how far points `(n, 2)` are from the sides, positive inside, `(n,)`.

        The distances are infinite where there are no sides.
        """
        points = self._in_frame(points)
        inside = _are_inside(self.corners, points)
        if not self.sides:
            return np.where(inside, np.inf, -np.inf)
        distances = distances_to(self.sides, points).min(axis=1)
        return np.asarray(np.where(inside, distances, -distances))

    def meeting(self, path: Segment) -> float:
        """Return how far along `path` it last meets the border, 0 to 1."""
        start, end = self._in_frame(np.array(path)).tolist()
        shares = (meeting(((start[0], start[1]), (end[0], end[1])), side) for side in self.sides)
        return max((share for share in shares if share is not None), default=1.0)

    def _in_frame(self, points: Float64Array) -> Float64Array:
        return np.clip(points, _INSIDE, np.array(self.size) - _INSIDE)


Border = PlacedLine | Zone
"""The first of its directions leads to its positive side, the second to its negative side."""


def distances_to(segments: Sequence[Segment], points: Float64Array) -> Float64Array:
    """Return how far points `(n, 2)` are from the nearest points of segments `(m)`, `(n, m)`."""
    starts, ends = np.array(segments).swapaxes(0, 1)
    ways, there = ends - starts, points[:, np.newaxis] - starts
    shares = np.clip((there * ways).sum(axis=2) / (ways**2).sum(axis=1), 0, 1)
    return np.asarray(np.hypot(*np.moveaxis(there - shares[..., np.newaxis] * ways, 2, 0)))


def _are_inside(corners: Sequence[Point], points: Float64Array) -> BoolArray:
    """Return which of the points `(n, 2)` lie in a polygon; those on a side may be in or out.

    A point is in where a ray from it meets an odd number of sides (Shimrat 1962).
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
    size = width, height

    def placed(point: Point) -> Point:
        return _snapped(point[0] * width, width), _snapped(point[1] * height, height)

    lines = tuple(
        PlacedLine(line.name, (line.left, line.right), start, end, _reach(start, end, size), size)
        for line in settings.lines
        for start, end in [(placed(line.start), placed(line.end))]
    )
    zones = tuple(
        Zone(zone.name, corners, _inner_sides(corners, size), size)
        for zone in settings.zones
        for corners in [tuple(map(placed, zone.points))]
    )
    return lines, zones


def _reach(start: Point, end: Point, size: _Size) -> Segment:
    """Lengthen a line beyond the edge of the frame where it ends there: feet may be there too."""
    factor = sum(size) / math.dist(start, end)
    dx, dy = factor * (end[0] - start[0]), factor * (end[1] - start[1])
    at_edge = [
        any(value in (0, length) for value, length in zip(point, size, strict=True))
        for point in (start, end)
    ]
    return (
        (start[0] - dx, start[1] - dy) if at_edge[0] else start,
        (end[0] + dx, end[1] + dy) if at_edge[1] else end,
    )


def _inner_sides(corners: Sequence[Point], size: _Size) -> tuple[Segment, ...]:
    """Return the sides of a polygon that do not run along the edge of the frame."""
    return tuple(
        side
        for side in sides(corners)
        if not any(a == b and a in (0, length) for a, b, length in zip(*side, size, strict=True))
    )


def _snapped(value: float, length: float) -> float:
    """Return a coordinate, moved onto the frame's edge where it is very near to it."""
    near = max(min(1.0, _MOST_AT_EDGE * length), _AT_EDGE * length)
    if value <= near:
        return 0.0
    return float(length) if length - value <= near else value
