"""The sections `regions` and `traffic`: places in the frame.

Points are fractions of the frame's width and height. In a file with `camera.size` they are pixels
of frames of that size, until `to_fractions` changes them.
"""

from collections.abc import Callable, Collection, Iterable
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, field_validator, model_validator

from vdet.config.section import Section
from vdet.polygons import Point, crosses_itself

Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Place = tuple[Coordinate, Coordinate]
Side = Annotated[int, Field(ge=16, le=100_000)]
Size = tuple[Side, Side]
"""Width and height of frames, in pixels."""
Name = Annotated[str, Field(min_length=1, max_length=80)]

MAX_CORNERS = 100
MAX_SHAPES = 100
SHORTEST_LINE = 0.01
"""Length of the shortest line, as a fraction of the frame's width or height."""


def check_shapes(shapes: Iterable[tuple[str, Iterable[Point]]]) -> None:
    """Raise a `ValueError` if two shapes have one name, or a point is not in the frame."""
    seen: set[str] = set()
    for name, points in shapes:
        if name in seen:
            raise ValueError(f"{name}: the name is used twice; names must be unique")
        seen.add(name)
        if any(not (0 <= x <= 1 and 0 <= y <= 1) for x, y in points):
            raise ValueError(
                f"{name}: a point is outside the frame; points are in pixels of "
                "camera.size, or without it in fractions of the frame"
            )


def _check_polygon(points: tuple[Point, ...]) -> tuple[Point, ...]:
    is_closed = len(points) > 1 and points[0] == points[-1]
    corners = points[:-1] if is_closed else points
    if len(corners) < 3:
        raise ValueError(f"has {len(corners)} corners; a polygon needs at least 3")
    if crosses_itself(corners):
        raise ValueError("crosses or touches itself; list the corners in order")
    return corners


Polygon = Annotated[
    tuple[Place, ...], Field(max_length=MAX_CORNERS), AfterValidator(_check_polygon)
]


class RegionSettings(Section):
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
    check_shapes((region.name, region.points or ()) for region in regions)
    return regions


RegionList = Annotated[
    tuple[RegionSettings, ...], Field(max_length=MAX_SHAPES), AfterValidator(_check_regions)
]


class LineSettings(Section):
    """A line; crossings are counted by direction."""

    name: Name
    """Unique name."""
    start: Place
    """Start, x and y."""
    end: Place
    """End, x and y."""
    left: Name = "left"
    """Name of the direction to the left, seen from the start."""
    right: Name = "right"
    """Name of the direction to the right."""

    @model_validator(mode="after")
    def _has_two_directions(self) -> "LineSettings":
        if self.left == self.right:
            raise ValueError("left and right must have different names")
        return self


class ZoneSettings(Section):
    """A zone; vehicles that enter, leave and stay are counted."""

    name: Name
    """Unique name."""
    points: Polygon
    """Corners in order, x and y. The last corner is joined to the first."""


INTERVALS = {"s": 1, "min": 60, "h": 3600}
"""Seconds of each unit of an interval."""
_DAY = 24 * 3600


class TrafficSettings(Section):
    """Lines and zones at which vehicles are counted (`vdet.traffic` explains the rule)."""

    lines: tuple[LineSettings, ...] = Field((), max_length=MAX_SHAPES)
    """Lines."""
    zones: tuple[ZoneSettings, ...] = Field((), max_length=MAX_SHAPES)
    """Zones."""
    interval: str | None = Field(None, pattern=r"^[1-9][0-9]{0,4} ?(s|min|h)$")
    """Interval of tables and charts, such as 5min, 15min or 1h. null: the whole video; 1min in
    charts.
    """
    draw: bool = False
    """Draw the lines and zones with their current counts into the video."""
    min_seen_seconds: float = Field(0.2, ge=0, le=10)
    """Minimum seconds of detections for a vehicle to count."""

    def __bool__(self) -> bool:
        return bool(self.lines or self.zones)

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
        seconds = cls.model_construct(interval=interval).seconds
        if seconds and _DAY % seconds:
            raise ValueError(f"{interval} does not divide a day; try 30s, 5min, 15min or 1h")
        return interval

    @model_validator(mode="after")
    def _lie_in_the_frame(self) -> "TrafficSettings":
        lines = [(line.name, (line.start, line.end)) for line in self.lines]
        check_shapes([*lines, *((zone.name, zone.points) for zone in self.zones)])
        for name, ((ax, ay), (bx, by)) in lines:
            if max(abs(ax - bx), abs(ay - by)) < SHORTEST_LINE:
                raise ValueError(f"{name}: is shorter than 1 % of the frame; make it longer")
        return self


_POINTS = {"points", "start", "end", "pixel"}
"""The keys of points, or lists of points, in all sections."""
_DIGITS = 3  # of pixels


def to_fractions(values: dict[str, Any]) -> dict[str, Any]:
    """Return settings with `camera.size` with the points as fractions of the frame.

    What is not a point or a size is kept, to be reported with all other mistakes.
    """
    return _scaled(values, lambda value, side: value / side)


def to_pixels(values: dict[str, Any]) -> dict[str, Any]:
    """Return settings with `camera.size` with the points as pixels of such frames."""
    return _scaled(values, lambda value, side: round(value * side, _DIGITS))


def _scaled(values: dict[str, Any], scale: Callable[[float, float], float]) -> dict[str, Any]:
    def scaled(value: Any) -> Any:
        match value:
            case [int() | float() as x, int() | float() as y]:
                return [scale(x, size[0]), scale(y, size[1])]
            case [*points]:
                return [scaled(point) for point in points]
        return value

    match size := inside(values, "camera", "size"):
        case [int() | float() as width, int() | float() as height] if width > 0 and height > 0:
            return dict(with_changed(values, _POINTS, scaled))
    return values


def with_changed(values: Any, keys: Collection[str], change: Callable[[Any], Any]) -> Any:
    """Return settings with the values of some keys changed, in nested sections and lists too."""
    if isinstance(values, list):
        return [with_changed(item, keys, change) for item in values]
    if not isinstance(values, dict):
        return values
    return {
        key: change(value) if key in keys else with_changed(value, keys, change)
        for key, value in values.items()
    }


def inside(values: Any, *keys: str) -> Any:
    """Return the value of a key in nested sections; None where there is none."""
    for key in keys:
        values = values.get(key) if isinstance(values, dict) else None
    return values
