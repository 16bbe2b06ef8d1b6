"""Lines and zones in pixels of the frames of one video, and the state of a vehicle at each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from vdet.config.places import TrafficSettings
from vdet.polygons import Point, Segment, contains, distance_to, meeting, side_of, sides

ENTER, EXIT, APPEAR, VANISH = "enter", "exit", "appear", "vanish"
"""Directions of a zone: over its border, or first and last seen inside."""

TIME_DIGITS = 4
"""Decimals of a duration in seconds that are compared: times are rounded."""

_SETTLED = 0.1
"""Seconds after which a vehicle off a border's band has changed the side."""
BAND = 0.05
"""Distance from a border within which a vehicle is on neither side, in heights of its box."""
LEAST_BAND = 0.003
"""Smallest such distance, as a share of the frame's height."""
_AT_EDGE = 0.002
"""A point within this share of the frame's side (or one pixel) of the frame's edge lies on it."""
_MOST_AT_EDGE = 0.005
"""Limit of that one pixel in small frames, as a share; lines are longer (`SHORTEST_LINE`)."""
_INSIDE = 0.01
"""Pixels from the edge of the frame to which points outside are moved."""

_Size = tuple[float, float]


@dataclass(frozen=True, slots=True)
class PlacedLine:
    """A line; its positive side is the left of someone who looks from `start` to `end`.

    `directions` are the names of the left and of the right. `start` and `end` are those that are
    drawn; `reach` goes on where they lie at the edge of the frame.
    """

    name: str
    directions: tuple[str, str]
    start: Point
    end: Point
    reach: Segment

    @property
    def length(self) -> float:
        """Pixels."""
        return math.dist(self.start, self.end)

    def distance(self, point: Point) -> float:
        """Return the distance from the line, also from beyond its ends; positive on the left."""
        return side_of(self.end, self.start, point)

    def meeting(self, path: Segment) -> float | None:
        """Return the share of the way along `path` at which it meets the line, if it does."""
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

    def distance(self, point: Point) -> float:
        """Return the distance from the sides, positive inside; infinite where there are none."""
        point = self._in_frame(point)
        distance = min((distance_to(side, point) for side in self.sides), default=math.inf)
        return distance if contains(self.corners, point) else -distance

    def meeting(self, path: Segment) -> float | None:
        """Return the share of the way along `path` at which it last meets a side, if it does."""
        inside = self._in_frame(path[0]), self._in_frame(path[1])
        shares = (meeting(inside, side) for side in self.sides)
        return max((share for share in shares if share is not None), default=None)

    def _in_frame(self, point: Point) -> Point:
        x, y = (
            min(max(value, _INSIDE), length - _INSIDE)
            for value, length in zip(point, self.size, strict=True)
        )
        return x, y


Border = PlacedLine | Zone
"""The first of its directions leads to its positive side, the second to its negative side."""


def place(
    settings: TrafficSettings, width: int, height: int
) -> tuple[tuple[PlacedLine, ...], tuple[Zone, ...]]:
    """Place lines and zones in frames of `width` × `height` pixels."""
    size = width, height

    def placed(point: Point) -> Point:
        return _snapped(point[0] * width, width), _snapped(point[1] * height, height)

    lines = tuple(
        PlacedLine(each.name, (each.left, each.right), start, end, _reach(start, end, size))
        for each in settings.lines
        for start, end in [(placed(each.start), placed(each.end))]
    )
    zones = tuple(
        Zone(each.name, corners, _inner_sides(corners, size), size)
        for each in settings.zones
        for corners in [tuple(map(placed, each.points))]
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


class Sighting(NamedTuple):
    """A vehicle as it is seen in a frame: where its foot is, and the height of its box, pixels."""

    time: float
    frame: int
    point: Point
    height: float
    score: float


@dataclass(frozen=True, slots=True)
class Change:
    """A change to the side of the sign `side`; `where` is the point at which the path crosses.

    `meets` is False where the path passes beyond the ends of a line.
    """

    side: int
    time: float
    frame: int
    where: Point
    score: float
    meets: bool


@dataclass(slots=True)
class BorderState:
    """The state of a vehicle at a border.

    Attributes
    ----------
    side
        The settled side, 1 or -1; 0 before it is known.
    entered
        When it came into a zone in which it still is.
    clear
        Distance from `seen_at`, where it was seen last, within which nothing changes here, pixels.
    """

    border: Border
    side: int = 0
    entered: float | None = None
    clear: float = 0.0
    seen_at: Point = (0.0, 0.0)
    _sign: int = 0  # of the last place that was not exactly on the border
    _beyond: int = 0  # the side on which it is beyond the band
    _since: float = 0.0  # when it came there
    _far: int = 0  # the side on which it was seen one height away last, until that is confirmed
    _change: Change | None = None  # the last time at which it was over the border
    _crossed: Point | None = None  # where it last crossed and was counted

    @property
    def has_crossed(self) -> bool:
        """Whether the vehicle was counted here."""
        return self._crossed is not None

    def see(self, sighting: Sighting, before: Sighting, band: float) -> Change | None:
        """Add the next sighting; return the change of the settled side, if there is one.

        `before` is the last sighting, or the same one at first. The first side that is settled is
        no change.
        """
        distance = self.border.distance(sighting.point)
        sign = (distance > 0) - (distance < 0)
        if sign and self._sign == -sign:
            self._change = _change(before, sighting, sign, self.border)
        self._sign = sign or self._sign
        is_settled = self.side == sign == self._beyond
        self.seen_at = sighting.point
        self.clear = abs(distance) if is_settled and abs(distance) > band else 0.0
        is_far = abs(distance) >= sighting.height
        was_far = self._far == sign
        self._far = sign if is_far and abs(distance) > band else 0
        if abs(distance) <= band:
            self._beyond = 0
            return self._settle(sign, sighting, is_far=True) if was_far and sign else None
        if self._beyond != sign:
            self._beyond, self._since = sign, sighting.time
        if was_far or round(sighting.time - self._since, TIME_DIGITS) >= _SETTLED:
            return self._settle(sign, sighting, is_far=is_far or was_far)
        return None

    def end(self, last: Sighting) -> Change | None:
        """Return the change that the last sighting shows, if the vehicle is not seen again."""
        return self._settle(self._far, last, is_far=True) if self._far else None

    def _settle(self, side: int, sighting: Sighting, *, is_far: bool) -> Change | None:
        if self.side in (side, 0):
            self.side = side
            return None
        change, crossed = self._change, self._crossed
        if change is None or change.side != side:  # it was on the border when it was first seen
            return None
        if crossed and not is_far and math.dist(change.where, crossed) < sighting.height:
            return None
        self.side = side
        self._crossed = change.where if change.meets else None
        return change


def _change(before: Sighting, after: Sighting, side: int, border: Border) -> Change:
    share = border.meeting((before.point, after.point))
    along = 1.0 if share is None else share
    (ax, ay), (bx, by) = before.point, after.point
    time = before.time + along * (after.time - before.time)
    where = ax + along * (bx - ax), ay + along * (by - ay)
    return Change(side, time, after.frame, where, after.score, meets=share is not None)
