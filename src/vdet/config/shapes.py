"""The sections `regions` and `traffic`, and the base class of all shapes: points in the frame.

Points keep the size that they are given for, and `Shape.for_frames` scales them once, for the
frames at hand.
"""

import re
from collections import Counter
from collections.abc import Iterable
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, field_validator, model_validator

from vdet.config.classes import standard_class
from vdet.config.section import Section
from vdet.errors import ConfigError
from vdet.polygons import Point

Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
FramePoint = tuple[Coordinate, Coordinate]
"""x to the right and y down, in frames of the size that belongs to the point."""
Length = Annotated[int, Field(ge=1, le=100_000)]
Side = Annotated[int, Field(ge=16, le=100_000)]
Size = tuple[Side, Side]
"""Width and height of frames, in pixels."""
Name = Annotated[str, Field(min_length=1, max_length=80)]
Approach = Literal["N", "NE", "E", "SE", "S", "SW", "W", "NW"]

FRACTIONS = 1, 1
"""The size of points that are fractions of the frame."""
MAX_CORNERS = 100
MAX_SHAPES = 100
SHORTEST_LINE = 0.01
"""Length of the shortest line, as a fraction of the frame's width or height."""
_ASPECT_TOLERANCE = 0.01
"""Largest relative difference of the aspect ratios of a frame and of the size of points."""


def aspect_problem(size: tuple[int, int], width: int, height: int) -> str | None:
    """Return what is wrong with points for `size` in frames of another aspect ratio, else None."""
    aspect = (width / height) / (size[0] / size[1])
    if size == FRACTIONS or abs(aspect - 1) <= _ASPECT_TOLERANCE:
        return None
    return (
        f"camera.size: points are for frames of {size[0]}×{size[1]}, whose aspect ratio differs "
        f"from {width}×{height}; define them for this size"
    )


class Shape(Section):
    """Points in frames of one size.

    `point_fields` are the fields with a point or a tuple of points.
    """

    point_fields: ClassVar[tuple[str, ...]] = ("points",)

    size: tuple[Length, Length] = FRACTIONS
    """Width and height of the frames that the points refer to, explained at `camera.size`."""

    def for_frames(self, width: int, height: int) -> Self:
        """Return the shape with its points in pixels of frames of `width` × `height`.

        Raises
        ------
        ConfigError
            The points are for frames of another aspect ratio.
        """
        if self.size == (width, height):
            return self
        if problem := aspect_problem(self.size, width, height):
            raise ConfigError(problem)
        across, down = self.size

        def scaled(value: Any) -> Any:
            match value:
                case (int() | float() as x, int() | float() as y):
                    return x * width / across, y * height / down
                case tuple():
                    return tuple(map(scaled, value))
            return value  # a region with a mask has no points

        points = {name: scaled(getattr(self, name)) for name in self.point_fields}
        return self.model_copy(update={**points, "size": (width, height)})


def check_shapes(shapes: Iterable["RegionSettings | LineSettings | ZoneSettings"]) -> None:
    """Raise a `ValueError` if two shapes have one name, or a point is not in the frame."""
    seen: set[str] = set()
    for shape in shapes:
        if shape.name in seen:
            raise ValueError(f"{shape.name}: the name is used twice; names must be unique")
        seen.add(shape.name)
        points = (shape.start, shape.end) if isinstance(shape, LineSettings) else shape.points or ()
        width, height = shape.size
        if any(not (0 <= x <= width and 0 <= y <= height) for x, y in points):
            raise ValueError(
                f"{shape.name}: a point is outside the frame; points are in pixels of "
                "camera.size, or without it in fractions of the frame"
            )


def _check_polygon(points: tuple[Point, ...]) -> tuple[Point, ...]:
    is_closed = len(points) > 1 and points[0] == points[-1]
    corners = points[:-1] if is_closed else points
    if len(corners) < 3:
        raise ValueError(f"has {len(corners)} corners; a polygon needs at least 3")
    return corners


Polygon = Annotated[
    tuple[FramePoint, ...], Field(max_length=MAX_CORNERS), AfterValidator(_check_polygon)
]


class RegionSettings(Shape):
    """A region in which vehicles are shown, or not: a polygon or a mask."""

    name: Name
    """Unique name."""
    points: Polygon | None = None
    """Corners of a polygon in order, x and y. The last corner is joined to the first."""
    mask: str | None = Field(None, min_length=1, max_length=4096)
    """Image with the aspect ratio of the frame, white inside the region."""
    kind: Literal["include", "exclude"] = "include"
    """include: show vehicles in it. exclude: do not show them, even inside an included region."""

    @model_validator(mode="after")
    def _has_a_shape(self) -> "RegionSettings":
        if (self.points is None) == (self.mask is None):
            raise ValueError(f"{self.name}: needs either points or mask")
        return self


def _check_regions(regions: tuple[RegionSettings, ...]) -> tuple[RegionSettings, ...]:
    check_shapes(regions)
    return regions


RegionList = Annotated[
    tuple[RegionSettings, ...], Field(max_length=MAX_SHAPES), AfterValidator(_check_regions)
]


class LineSettings(Shape):
    """A line; crossings are counted by direction."""

    point_fields: ClassVar[tuple[str, ...]] = ("start", "end")

    name: Name
    """Unique name."""
    start: FramePoint
    """Start, x and y."""
    end: FramePoint
    """End, x and y."""
    left: Name = "left"
    """Name of the direction to the left, seen from the start."""
    right: Name = "right"
    """Name of the direction to the right."""
    approach: Approach | None = None
    """Arm of a junction that it lies across: N, NE, E, SE, S, SW, W or NW. Flows between the lines
    of arms are turning movements.
    """
    flows: bool = True
    """Whether flows begin and end at it."""

    @model_validator(mode="after")
    def _has_two_directions(self) -> "LineSettings":
        if self.left == self.right:
            raise ValueError("left and right must have different names")
        return self


class ZoneSettings(Shape):
    """A zone; vehicles that enter, leave and stay are counted."""

    name: Name
    """Unique name."""
    points: Polygon
    """Corners in order, x and y. The last corner is joined to the first."""
    flows: bool = True
    """Whether flows begin and end in it."""


_INTERVAL = re.compile("[1-9][0-9]{0,4} ?(s|min|h)", re.ASCII)
INTERVALS = {"s": 1, "min": 60, "h": 3600}
"""Seconds of each unit of an interval."""
_DAY = 24 * 3600


ZONE_DIRECTIONS = "enter", "exit", "appear", "vanish"
"""Directions of a zone: across its border, or first and last seen inside."""
NOWHERE = "(none)"
"""In tables, the destination of a flow that ends at its first line or zone."""


class TrafficSettings(Section):
    """Lines and zones at which vehicles are counted (`vdet.traffic` explains the rule)."""

    lines: tuple[LineSettings, ...] = Field((), max_length=MAX_SHAPES)
    """Lines."""
    zones: tuple[ZoneSettings, ...] = Field((), max_length=MAX_SHAPES)
    """Zones."""
    interval: str | None = None
    """Interval of tables and charts, such as 5min, 15min or 1h. null: the whole video; 1min in
    charts.
    """
    draw: bool = False
    """Draw the lines and zones with their current counts into the video."""
    min_seen_seconds: float = Field(0.2, ge=0, le=10)
    """Minimum seconds of detections for a vehicle to count."""
    pcu: Annotated[
        dict[Name, Annotated[float, Field(ge=0, le=100)]],
        AfterValidator(
            lambda table: {standard_class(name) or name: pcu for name, pcu in table.items()}
        ),
    ] = Field({}, max_length=100)
    """Passenger car units of each class, such as {truck: 2, bus: 2}; other classes have 1. {}: none
    in workbooks.
    """

    def __bool__(self) -> bool:
        return bool(self.lines or self.zones)

    @property
    def shapes(self) -> tuple[LineSettings | ZoneSettings, ...]:
        """The lines, then the zones."""
        return (*self.lines, *self.zones)

    @property
    def directions(self) -> dict[str, tuple[str, ...]]:
        """The directions of each line and zone, by its name."""
        directions = {line.name: (line.left, line.right) for line in self.lines}
        return {**directions, **{zone.name: ZONE_DIRECTIONS for zone in self.zones}}

    @property
    def outside_flows(self) -> tuple[str, ...]:
        """The names of the lines and zones at which flows neither begin nor end."""
        return tuple(shape.name for shape in self.shapes if not shape.flows)

    @property
    def seconds(self) -> int | None:
        """The interval in seconds; None for the whole video."""
        if self.interval is None:
            return None
        number = self.interval.rstrip("sminh ")
        return int(number) * INTERVALS[self.interval[len(number) :].strip()]

    @field_validator("interval")
    @classmethod
    def _divides_a_day(cls, interval: str | None) -> str | None:
        if interval is not None and not _INTERVAL.fullmatch(interval):
            raise ValueError(f"{interval!r} is not an interval; try 30s, 5min, 15min or 1h")
        seconds = cls.model_construct(interval=interval).seconds
        if seconds and _DAY % seconds:
            raise ValueError(f"{interval} does not divide a day; try 30s, 5min, 15min or 1h")
        return interval

    @model_validator(mode="after")
    def _lie_in_the_frame(self) -> "TrafficSettings":
        check_shapes(self.shapes)
        columns = [f"{name}: {way}" for name, ways in self.directions.items() for way in ways]
        if NOWHERE in self.directions:
            raise ValueError(f"{NOWHERE}: is reserved for flows without a destination; rename it")
        for column, number in Counter(columns).items():
            if number > 1:
                raise ValueError(f"{column}: would be two columns of a table; rename one")
        for line in self.lines:
            (ax, ay), (bx, by), (width, height) = line.start, line.end, line.size
            if max(abs(ax - bx) / width, abs(ay - by) / height) < SHORTEST_LINE:
                raise ValueError(f"{line.name}: is shorter than 1 % of the frame; make it longer")
        return self

    def for_frames(self, width: int, height: int) -> "TrafficSettings":
        """Return the section with all points in pixels of frames; errors as `Shape.for_frames`."""
        lines = tuple(line.for_frames(width, height) for line in self.lines)
        zones = tuple(zone.for_frames(width, height) for zone in self.zones)
        return self.model_copy(update={"lines": lines, "zones": zones})
