"""The clock of a video: the moment at which it begins, and where that is known from."""

import logging
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, tzinfo
from pathlib import Path

from vdet.config.camera import moment
from vdet.config.schema import Settings
from vdet.errors import ConfigError
from vdet.media.numbered import find_sequence

_log = logging.getLogger("vdet")
_SAME = timedelta(minutes=1)
"""Largest difference of the times in the name and in the metadata of a video that are one."""


@dataclass(frozen=True, slots=True)
class Clock:
    """When a video was recorded.

    Attributes
    ----------
    zero
        The moment of time 0 in the video, in UTC.
    source
        Where it is known from, for messages.
    zone
        The time zone of the moments that `at` returns; None for that of this computer.
    first
        Time of the first frame in the video, seconds.
    """

    zero: datetime
    source: str
    zone: tzinfo | None = None
    first: float = 0.0

    def __str__(self) -> str:
        return f"{_text(self.at(self.first))} ({self.source})"

    @property
    def second_of_day(self) -> float:
        """The second of the day at time 0 in the video."""
        zero = self.at(0.0).replace(tzinfo=None)
        return (zero - zero.replace(hour=0, minute=0, second=0, microsecond=0)).total_seconds()

    def at(self, seconds: float) -> datetime:
        """Return the moment of a time in the video, with the offset of its zone at that moment."""
        return (self.zero + timedelta(seconds=seconds)).astimezone(self.zone)


def find_clock(
    path: Path,
    settings: Settings,
    created: str | None = None,
    start: float = 0.0,
    zero: datetime | None = None,
) -> Clock | None:
    """Return the clock of a video; None if nothing says when it begins.

    `input.begin` decides, then the pattern of `camera.clock`, then `zero`, then a time in its name
    or in that of its first picture, then the creation time of the video. A time without a zone is
    in that of the camera. If the name and the creation time differ by more than a minute, a warning
    (logger "vdet") has both.

    Parameters
    ----------
    path
        The video, or a file that is named after it.
    created
        The creation time in the metadata of the file.
    start
        Time of its first frame in the video, seconds.
    zero
        The moment of time 0, where the file itself says so.

    Raises
    ------
    ConfigError
        The name has no time as the pattern says.
    """
    clock = settings.camera.clock
    zone: tzinfo | None = clock.time_zone
    if zero and not (settings.input.begin or clock.pattern):
        return Clock(_utc(zero, zone), "from the file", zone or zero.tzinfo, start)
    if settings.input.begin:
        begin, source = moment(settings.input.begin), "as given"
        zone = zone or begin.tzinfo
    elif found := _found(path, settings, created):
        begin, source = found
    else:
        return None
    return Clock(_utc(begin, zone) - timedelta(seconds=start), source, zone, start)


def _found(path: Path, settings: Settings, created: str | None) -> tuple[datetime, str] | None:
    """Return when a video begins by its name and its metadata, and which of these says so."""
    clock, zone = settings.camera.clock, settings.camera.clock.time_zone
    sequence = find_sequence(path)
    named, written = clock.time_in((sequence.files[0] if sequence else path).name), None
    if clock.pattern and not named:
        raise ConfigError(
            f"{path}: its name has no time like {clock.pattern}: camera.clock.pattern"
        )
    with suppress(ValueError):
        written = moment(created or "")
    if not named:
        return (written, "its creation time") if written else None
    if written and not clock.pattern and abs(_utc(named, zone) - _utc(written, zone)) > _SAME:
        by_name, by_metadata = (
            _text(_utc(time, zone).astimezone(zone)) for time in (named, written)
        )
        _log.warning(
            "%s: begins %s by its name, %s by its metadata; the name is used; --begin decides",
            *(path, by_name, by_metadata),
        )
    return named, "from its name"


def _utc(time: datetime, zone: tzinfo | None) -> datetime:
    """Return a moment in UTC; without a zone of its own it is local time in `zone`."""
    return (time if time.tzinfo or not zone else time.replace(tzinfo=zone)).astimezone(UTC)


def _text(time: datetime) -> str:
    return time.isoformat(" ", "seconds")
