"""Lines and zones in pixels of the frames of one video."""

import math
from dataclasses import dataclass
from typing import ClassVar, Protocol

from vdet.config.places import CountSettings, LineSettings
from vdet.polygons import (
    Outline,
    Point,
    Segment,
    at_edge,
    meeting,
    side_of,
    snapped_to_edge,
)

ENTER, EXIT, APPEAR, VANISH = "enter", "exit", "appear", "vanish"
"""Directions of a zone: over its border, or first and last seen inside."""

_BAND = 0.05
"""Distance from a border within which a vehicle is on neither side, in heights of its box."""
_LEAST_BAND = 0.003
"""Smallest such distance, as a share of the frame's height."""


class Border(Protocol):
    """A line or a zone: it has two sides, and directions in which vehicles change the side."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def directions(self) -> tuple[str, ...]:
        """All directions that are counted at it."""

    def direction(self, side: int) -> str:
        """Return the direction of a change to the side of this sign."""

    def distance(self, point: Point) -> float:
        """Return the distance of a point in pixels; its sign is that of the side."""

    def meeting(self, path: Segment) -> float | None:
        """Return the share of the way along `path` at which it is crossed; None if it is not."""


@dataclass(frozen=True, slots=True)
class Line:
    """A line; its positive side is the right of someone who looks from `start` to `end`.

    `start` and `end` are those that are drawn; `reach` goes on where they lie at the frame's edge.
    """

    name: str
    start: Point
    end: Point
    left: str
    right: str
    reach: Segment

    @property
    def directions(self) -> tuple[str, ...]:
        """Left and right, by the names that the user gave."""
        return self.left, self.right

    def direction(self, side: int) -> str:
        """Return the direction of a crossing to this side."""
        return self.right if side > 0 else self.left

    def distance(self, point: Point) -> float:
        """Return the distance from the line, also from beyond its ends; positive on the right."""
        return side_of(self.start, self.end, point)

    def meeting(self, path: Segment) -> float | None:
        """Return the share of the way along `path` at which it meets the line."""
        return meeting(path, self.reach)


@dataclass(frozen=True, slots=True)
class Zone:
    """A zone; its positive side is the inside."""

    name: str
    outline: Outline
    directions: ClassVar[tuple[str, ...]] = (ENTER, EXIT, APPEAR, VANISH)

    def direction(self, side: int) -> str:
        """Return the direction of a change to this side."""
        return ENTER if side > 0 else EXIT

    def distance(self, point: Point) -> float:
        """Return the distance from the border; positive inside."""
        return self.outline.distance(point)

    def meeting(self, path: Segment) -> float | None:
        """Return the share of the way along `path` at which it last crosses the border."""
        return self.outline.meeting(path)


@dataclass(frozen=True, slots=True)
class Layout:
    """The lines and zones of a video with the rule that counts at them.

    `size` is the width and height of the frames, pixels.
    """

    lines: tuple[Line, ...]
    zones: tuple[Zone, ...]
    size: tuple[int, int]
    settings: CountSettings

    @property
    def borders(self) -> tuple[Line | Zone, ...]:
        """All lines, then all zones."""
        return (*self.lines, *self.zones)

    @property
    def keys(self) -> tuple[tuple[str, str], ...]:
        """Every name with every direction that is counted there."""
        return tuple((each.name, way) for each in self.borders for way in each.directions)

    def band(self, height: float) -> float:
        """Return the pixels from a border within which a box of this height is on neither side."""
        return max(_BAND * height, _LEAST_BAND * self.size[1])


def lay_out(settings: CountSettings, width: int, height: int) -> Layout:
    """Place lines and zones in frames of `width` × `height` pixels.

    Raises
    ------
    ConfigError
        They are given for frames of another aspect ratio.
    """
    across, down = settings.scales(width, height)

    def placed(point: Point) -> Point:
        return point[0] * across, point[1] * down

    size = float(width), float(height)
    lines = tuple(
        _line(each, placed(each.start), placed(each.end), size) for each in settings.lines
    )
    zones = tuple(
        Zone(each.name, Outline.laid([placed(point) for point in each.points], size))
        for each in settings.zones
    )
    return Layout(lines, zones, (width, height), settings)


def _line(settings: LineSettings, start: Point, end: Point, size: tuple[float, float]) -> Line:
    """Make a line; an end at the frame's edge goes on beyond it, where feet may be too."""
    start, end = snapped_to_edge(start, size), snapped_to_edge(end, size)
    factor = sum(size) / math.dist(start, end)
    dx, dy = factor * (end[0] - start[0]), factor * (end[1] - start[1])
    first = (start[0] - dx, start[1] - dy) if at_edge(start, size) else start
    last = (end[0] + dx, end[1] + dy) if at_edge(end, size) else end
    return Line(settings.name, start, end, settings.left, settings.right, (first, last))
