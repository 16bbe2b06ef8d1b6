"""The clock of a video: the moment at which it begins, and where that is known from."""

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from vdet.errors import ConfigError

_IN_NAMES = re.compile(
    r"(?<!\d)(\d{4})[-_.]?(\d\d)[-_.]?(\d\d)[-_T ](\d\d)[-_.:]?(\d\d)[-_.:]?(\d\d)(?!\d)", re.ASCII
)
"""A time in the name of a file, such as 2026-05-01_07-00-00 or 20260501_070000."""

_DIGITS = {"%Y": r"\d{4}", **dict.fromkeys(("%m", "%d", "%H", "%M", "%S", "%y"), r"\d\d")}
"""The codes of a pattern, and what stands for each in a name."""

_EARLIEST, _LATEST = 1990, 9000  # years


@dataclass(frozen=True, slots=True)
class Clock:
    """When a video was recorded.

    Attributes
    ----------
    zero
        The moment of time 0 in the video, with its time zone.
    source
        Where it is known from, for messages.
    """

    zero: datetime
    source: str

    def __str__(self) -> str:
        return f"{self.zero.isoformat(' ', 'seconds')} ({self.source})"

    @property
    def second_of_day(self) -> float:
        """The second of the day at time 0 in the video."""
        midnight = self.zero.replace(hour=0, minute=0, second=0, microsecond=0)
        return (self.zero - midnight).total_seconds()

    def at(self, seconds: float) -> datetime:
        """Return the moment of a time in the video."""
        return self.zero + timedelta(seconds=seconds)


def check_begin(begin: str) -> None:
    """Refuse a text that `find_clock` could not use as `begin`. Raises `ConfigError`."""
    if is_pattern(begin):
        rest = re.sub("|".join(_DIGITS), "", begin)
        if "%" in rest or begin == rest:
            raise ConfigError(f"{begin!r}: a pattern has only {', '.join(_DIGITS)} and other text")
    else:
        _parsed(begin)


def is_pattern(begin: str) -> bool:
    """Return whether a text is the pattern of times in names, and not a time."""
    return "%" in begin


def find_clock(
    path: Path, begin: str | None = None, created: str | None = None, start: float = 0.0
) -> Clock | None:
    """Return the clock of a video; None if nothing says when it begins.

    A time without a zone is in the time zone of this computer.

    Parameters
    ----------
    path
        The video, or a file that is named after it.
    begin
        When it begins, as in ISO 8601, or the pattern of the time in its name, such as
        "%Y%m%d_%H%M%S". None: its creation time, else the time in its name.
    created
        The creation time in the metadata of the file.
    start
        Time of its first frame in the video, seconds.

    Raises
    ------
    ConfigError
        `begin` is neither, or the name has no such time.
    """
    found = _begin(path, begin, created)
    if found is None:
        return None
    moment, source = found
    return Clock(moment.astimezone(moment.tzinfo) - timedelta(seconds=start), source)


def _begin(path: Path, begin: str | None, created: str | None) -> tuple[datetime, str] | None:
    if begin and not is_pattern(begin):
        return _parsed(begin), "as given"
    if begin:
        codes = re.sub(r"%[a-zA-Z]|[^%]", lambda part: _code(part[0]), begin, flags=re.DOTALL)
        texts = re.findall(f"(?=({codes}))", path.name, re.ASCII)
        found = next(_moments(lambda text: datetime.strptime(text, begin), texts), None)
        if found is None:
            raise ConfigError(f"{path}: its name has no time like {begin}; give another --begin")
        return found, "from its name"
    if created and (moment := next(_moments(datetime.fromisoformat, [created]), None)):
        return moment.astimezone(), "its creation time"
    named = map("".join, _IN_NAMES.findall(path.name))
    in_name = next(_moments(lambda digits: datetime.strptime(digits, "%Y%m%d%H%M%S"), named), None)
    return (in_name, "from its name") if in_name else None


def _code(part: str) -> str:
    return _DIGITS.get(part) or re.escape(part)


def _moments(parse: Callable[[Any], datetime], values: Iterable[Any]) -> Iterator[datetime]:
    """Yield those values that are moments; cameras without a clock begin in 1904, 1970 or 1980."""
    for value in values:
        with suppress(ValueError):
            moment = parse(value)
            if _EARLIEST <= moment.year <= _LATEST:
                yield moment


def _parsed(text: str) -> datetime:
    if moment := next(_moments(datetime.fromisoformat, [text]), None):
        return moment
    raise ConfigError(f"{text!r} is not a time; give one as in '2026-05-01 07:00+02:00'")
