"""The section `camera`: the size that points are given for, the lens, the road and the clock."""

import re
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, ClassVar
from zoneinfo import ZoneInfo

from pydantic import Field, field_validator

from vdet.config.section import Section
from vdet.config.shapes import FramePoint, Shape, Size
from vdet.errors import ConfigError

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
