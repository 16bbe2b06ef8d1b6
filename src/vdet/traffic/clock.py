"""The clock of a video: the moment at which it begins, and where that is known from."""

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from vdet.config.camera import CODES, moment
from vdet.config.schema import Settings
from vdet.errors import ConfigError

_IN_NAMES = re.compile(
    r"(?<!\d)(\d{4})[-_.]?(\d\d)[-_.]?(\d\d)[-_T ](\d\d)[-_.:]?(\d\d)[-_.:]?(\d\d)(?!\d)", re.ASCII
)
"""A time in the name of a file, such as 2026-05-01_07-00-00 or 20260501_070000."""


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


def find_clock(
    path: Path, settings: Settings, created: str | None = None, start: float = 0.0
) -> Clock | None:
    """Return the clock of a video; None if nothing says when it begins.

    `input.begin` decides, then the pattern of `camera.clock`, then the creation time of the video,
    then a time in its name. A time without a zone is in the time zone of this computer.

    Parameters
    ----------
    path
        The video, or a file that is named after it.
    created
        The creation time in the metadata of the file.
    start
        Time of its first frame in the video, seconds.

    Raises
    ------
    ConfigError
        The name has no time as the pattern says.
    """
    found = _begin(path, settings, created)
    if found is None:
        return None
    begin, source = found
    return Clock(begin.astimezone(begin.tzinfo) - timedelta(seconds=start), source)


def _begin(path: Path, settings: Settings, created: str | None) -> tuple[datetime, str] | None:
    if begin := settings.input.begin:
        return moment(begin), "as given"
    if pattern := settings.camera.clock.pattern:
        codes = re.sub(r"%[a-zA-Z]|[^%]", lambda part: _code(part[0]), pattern, flags=re.DOTALL)
        texts = re.findall(f"(?=({codes}))", path.name, re.ASCII)
        found = next(_moments(lambda text: datetime.strptime(text, pattern), texts), None)
        if found is None:
            raise ConfigError(f"{path}: its name has no time like {pattern}: camera.clock.pattern")
        return found, "from its name"
    if created and (known := next(_moments(datetime.fromisoformat, [created]), None)):
        return known.astimezone(), "its creation time"
    named = map("".join, _IN_NAMES.findall(path.name))
    in_name = next(_moments(lambda digits: datetime.strptime(digits, "%Y%m%d%H%M%S"), named), None)
    return (in_name, "from its name") if in_name else None


def _code(part: str) -> str:
    return CODES.get(part) or re.escape(part)


def _moments(parse: Callable[[Any], datetime], values: Iterable[Any]) -> Iterator[datetime]:
    """Yield those values that are moments."""
    for value in values:
        with suppress(ValueError):
            yield moment(parse(value).isoformat())
