"""The sections `regions`, `traffic` and `camera`: what lies where in the frame, and the clock.

Points keep the size that they are given for, and `Shape.for_frames` scales them once, for the
frames at hand.
"""

import re
from collections import Counter
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar, get_args
from zoneinfo import ZoneInfo

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
APPROACHES: tuple[Approach, ...] = get_args(Approach)
"""The arms of a junction, clockwise from the north."""

Shapes = TypeVar("Shapes", bound="tuple[RegionSettings | LineSettings | ZoneSettings, ...]")

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


def checked_shapes(shapes: Shapes) -> Shapes:
    """Return shapes; raise a `ValueError` if two have one name, or a point is not in the frame."""
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
    return shapes


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


RegionList = Annotated[
    tuple[RegionSettings, ...], Field(max_length=MAX_SHAPES), AfterValidator(checked_shapes)
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
        checked_shapes(self.shapes)
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


EARLIEST, LATEST = datetime(1990, 1, 1, tzinfo=UTC), datetime(2200, 12, 31, tzinfo=UTC)
"""Limits of the times of recordings; cameras without a clock begin in 1904, 1970 or 1980."""
_LENS_TOLERANCE = 0.005  # accepts 854×480 for 1280×720

_Coefficient = Annotated[float, Field(ge=-1000, le=1000)]
_Row = tuple[float, float, float]
_Metres = Annotated[float, Field(ge=-1e8, le=1e8)]


class LensSettings(Section):
    """A pinhole camera with lens distortion, written by `vdet calibrate`.

    The distortion is Brown's model, as OpenCV implements it. All lengths are in pixels; x points
    right, y points down, and whole numbers are pixel centres.
    """

    size: Size
    """Width and height of the calibration photographs."""
    matrix: tuple[_Row, _Row, _Row]
    """Focal lengths and principal point: `((fx, 0, cx), (0, fy, cy), (0, 0, 1))`."""
    distortion: tuple[_Coefficient, _Coefficient, _Coefficient, _Coefficient, _Coefficient]
    """k1, k2, p1, p2, k3."""

    def matrix_for(self, width: int, height: int) -> tuple[_Row, _Row, _Row]:
        """Return the camera matrix for frames of another size, but the same aspect ratio.

        Raises
        ------
        ConfigError
            The aspect ratio differs, so the frame is not a resized one.
        """
        lens_width, lens_height = self.size
        across, down = width / lens_width, height / lens_height
        if abs(across / down - 1) > _LENS_TOLERANCE:
            sizes = f"{lens_width}×{lens_height}, not {width}×{height}"
            raise ConfigError(f"camera.lens: is for {sizes}; calibrate again")
        (fx, _, cx), (_, fy, cy), last = self.matrix
        x, y = (cx + 0.5) * across - 0.5, (cy + 0.5) * down - 0.5
        return (fx * across, 0.0, x), (0.0, fy * down, y), last


class GroundPoint(Shape):
    """A point of the road."""

    point_fields: ClassVar[tuple[str, ...]] = ("pixel",)

    pixel: FramePoint
    """Position in the frame, x and y; whole numbers are the centres of pixels."""
    metres: tuple[_Metres, _Metres]
    """Position on the road, x and y in metres at right angles, from any origin."""
    by: Literal["lane"] | None = None
    """lane: from the width of a lane alone, so lengths along it are a guess. null: measured."""


_TWO_DIGITS = r"(?:\d\d|(?<!\d)\d(?!\d))"
_CODES = {
    "%Y": r"\d{4}",
    **dict.fromkeys(("%m", "%d", "%H", "%I", "%M", "%S"), _TWO_DIGITS),
    "%y": r"\d\d",
    "%f": r"\d{1,6}",
    "%p": "[AaPp][Mm]",
    "%z": r"(?:Z|[+-]\d\d:?\d\d)",
}
"""The codes of a pattern of times, and the text that each stands for."""
_USUAL = re.compile(
    r"(?<!\d)(?P<date>\d{4}[-_.]?\d\d[-_.]?\d\d)(?:[-_T ]| at )?"
    r"(?P<time>\d\d[-_.:]?\d\d[-_.:]?\d\d)(?!\d)"
    r"(?:(?:[.,]|[-_](?=\d+[Zz]))(?P<fraction>\d+(?=[Zz+])|\d{3}|\d{6})(?![\dp]))?"
    r"(?:[-_\s]?(?:(?P<utc>[Zz]|UTC|GMT)|(?P<half>[AaPp])\.?[Mm])(?![a-zA-Z+])"
    r"|[-_\s]?(?P<offset>[+]\d\d:?\d\d|-\d\d:\d\d)(?!\d)"
    r"|[-_\s]?(?P<unread>(?:UTC|GMT)?[+]\d+|-(?:0[1-9]|1[0-2])[-_]?[03]0(?![-_.]?\d)"
    r"|(?:[ACEHJKMNP]|AE|AK|NZ)[SD]T(?![a-zA-Z])|(?:[CEW]E|CES|EES|[BI]S)T(?![a-zA-Z])))?"
)
"""A time in a name, such as 2026-05-01_07-00-00, 20260501T070000.123Z or 20260501070000+0200, and
what may be its zone but is not read: a number after a minus may count files, letters are ambiguous.
"""


def parse_date_time(text: str) -> datetime:
    """Return the date and time that a text in ISO 8601 states. Raises `ValueError`."""
    with suppress(ValueError):
        date_time = datetime.fromisoformat(text)
        if EARLIEST.year <= date_time.year <= LATEST.year:
            return date_time
    raise ValueError(f"{text!r} is not a time; expected one such as '2026-05-01 07:00+02:00'")


class ClockSettings(Section):
    """Start times of the camera's videos."""

    pattern: str | None = Field(None, max_length=200)
    """Pattern of the time in file names, such as %Y%m%d_%H%M%S. null: a time in the name, else the
    creation time in the video.
    """
    zone: ZoneInfo | None = None
    """Time zone of file names and tables, such as Europe/Berlin. null: that of this computer."""

    @field_validator("pattern")
    @classmethod
    def _has_known_codes(cls, pattern: str | None) -> str | None:
        if pattern is not None:
            literal_text = re.sub("|".join(_CODES), "", pattern)
            if "%" in literal_text or pattern == literal_text:
                raise ValueError(f"a pattern can only contain {', '.join(_CODES)} and other text")
            if ("%I" in pattern) != ("%p" in pattern):
                raise ValueError("%I and %p, the hour and its half of the day, need each other")
        return pattern

    def time_in(self, path: Path) -> datetime | None:
        """Return the time in the name of a file; None without one.

        If the pattern names folders, the last folders of the path are read, too. The time has a
        zone if the name has one.

        Raises
        ------
        ValueError
            Without a pattern: a time is followed by what may be a zone, but cannot be read.
        """
        if self.pattern is None:
            return _usual_time(path.name)
        parts = re.findall(r"%[a-zA-Z]|[^%]", self.pattern, re.DOTALL)
        codes = [part for part in parts if part in _CODES]
        form = "".join(f"({_CODES[part]})" if part in codes else re.escape(part) for part in parts)
        name = "/".join(path.absolute().parts[-1 - self.pattern.count("/") :])
        zone = "Z" if "%SZ" in self.pattern else ""
        for match in re.finditer(f"(?={form})", name, re.ASCII):
            values = dict(zip(codes, match.groups(), strict=True))  # folders may repeat the hour
            with suppress(ValueError):
                time = datetime.strptime(" ".join(values.values()), " ".join(values))
                return parse_date_time(time.isoformat() + zone)
        return None


def _usual_time(name: str) -> datetime | None:
    """Return the time in a name that has a usual form; None without one. Raises `ValueError`."""
    for match in _USUAL.finditer(name):
        values = match.groupdict(default="")
        date, time = (re.sub(r"\D", "", values[key]) for key in ("date", "time"))
        if half := values["half"].upper():
            time = f"{int(time[:2]) % 12 + 12 * (half == 'P'):02}{time[2:]}"
        zone = "Z" if values["utc"] else values["offset"]
        with suppress(ValueError):
            begin = parse_date_time(f"{date}T{time}.{values['fraction'] or '0'}{zone}")
            if not values["unread"]:
                return begin
            break
    else:
        return None
    raise ValueError(f"{values['unread']!r} after the time in its name may be a zone")


class CameraSettings(Section):
    """The camera: its frames, lens, road and clock. Lines and zones refer to its frames."""

    size: Size | None = None
    """Width and height in pixels of the frames that points in this file refer to. Other frame sizes
    need the same aspect ratio. null: points are fractions of the frame, 0 to 1. The key size of an
    item with points overrides it; [1, 1] stands for fractions.
    """
    lens: LensSettings | None = None
    """The lens, from `vdet calibrate`. null: no distortion."""
    ground: tuple[GroundPoint, ...] = Field((), max_length=100)
    """At least four points of the road in pixels and metres, around the part of the road in which
    speeds and distances are measured.
    """
    clock: ClockSettings = ClockSettings()

    @property
    def lack_of_speeds(self) -> str | None:
        """Why ground points give no speeds; None if they do, or if there are none."""
        why = "the width of a lane alone does not give lengths along it"
        advice = f"camera.ground: no speeds: {why}; also give a length along it in vdet draw"
        return advice if any(point.by for point in self.ground) else None
