"""The clock of a video and its source, and the intervals of tables and pages."""

import logging
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, tzinfo
from fractions import Fraction
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING

from vdet.config.scene import parse_date_time
from vdet.config.schema import Settings
from vdet.errors import ConfigError, clock_text
from vdet.media.frame import Tags
from vdet.media.images import numbered_images
from vdet.track.track import FrameTracks

if TYPE_CHECKING:
    from vdet.labels.label import SavedTracks

_log = logging.getLogger("vdet")
_SAME = timedelta(minutes=1)
"""Maximum difference between the times in the name and the metadata without a warning."""
OVERRIDE = "input.begin overrides it"
"""End of the warnings about clocks."""
_CREATED = "its creation time"
_EXPORTED, _FUTURE = f"{_CREATED}, perhaps of an export", f"{_CREATED}, in the future"

Span = tuple[float, float]
"""Start and end of a time span, seconds; of a part with video, its first and last frame."""

ClockTime = datetime | float | None
"""A clock time; without a clock, seconds in the video; None for several videos without one."""

GAP = 2.0
"""Maximum seconds between two times of one span, in `joined`."""
_LONGEST_FRAME = 60.0
"""Maximum duration of a frame, seconds; a later next frame means a part without video."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
SEAM = 2.0
"""Maximum seconds by the clocks from the last frame of a video to the first of the next one, if
that continues it: clocks of whole seconds differ by up to one, and so long may a frame last.
"""
_MAX_COUNT = 200_000
"""Maximum number of intervals: two days of seconds."""


@dataclass(frozen=True, slots=True)
class Clock:
    """When a video was recorded.

    Attributes
    ----------
    zero
        Clock time of the first frame of the video, which is at time 0, in UTC.
    source
        Where it comes from, for messages.
    zone
        Time zone of the values of `at`; None: that of this computer.
    """

    zero: datetime
    source: str
    zone: tzinfo | None = None

    def __str__(self) -> str:
        return f"{_time_text(self.at(0.0))} ({self.source})"

    @property
    def is_doubtful(self) -> bool:
        """Whether it is only the creation time of a file that was written again, or a wrong one."""
        return self.source in (_EXPORTED, _FUTURE)

    @property
    def has_whole_seconds(self) -> bool:
        """Whether its fractions of a second are unknown."""
        return self.at(0.0).microsecond == 0

    def at(self, seconds: float) -> datetime:
        """Return the clock time of a time in the video, with the offset of the zone then."""
        return (self.zero + timedelta(seconds=seconds)).astimezone(self.zone)


def find_clock(
    path: Path,
    settings: Settings,
    *,
    tags: Tags | None = None,
    length: Fraction | None = None,
    saved: "SavedTracks | None" = None,
) -> Clock | None:
    """Return the clock of a video; None if its start time is unknown.

    `input.begin` has priority, then the pattern of `camera.clock`, then saved tracks, then a time
    in the name of the video or its first image, then the creation time of the video. A time without
    a zone is local time of the camera. There is a warning (logger "vdet") if the creation time is
    more than a minute from the start and from the end by the name, or may be that of an export. The
    offset of a start time is that of the camera, unless it is that of this computer then.

    Parameters
    ----------
    path
        The video, or a file named after it.
    tags, length
        Its metadata, and its duration, seconds.
    saved
        Its tracks, if they are read from a file.

    Raises
    ------
    ConfigError
        The name does not match the pattern.
    """
    clock = settings.camera.clock
    zone: tzinfo | None = clock.zone
    zero = saved.begin if saved else None
    is_named = clock.pattern and (zero is None or clock.time_in(path))
    if settings.input.begin:
        begin, source = parse_date_time(settings.input.begin), "as given"
    elif saved and zero and not is_named:
        begin, source = zero, saved.begin_source
    elif begin_and_source := _begin_by_name(path, settings, tags or Tags(), length):
        begin, source = begin_and_source
        begin = begin if begin.utcoffset() else _utc(begin, zone).astimezone()
    else:
        return None
    name = os.environ.get("TZ", "").removeprefix(":")
    if not zone and name.startswith("/") and not Path(name).is_file():  # else it is UTC in silence
        raise ConfigError(f"TZ: {name} not found; set TZ or camera.clock.zone")
    if not zone and begin.utcoffset() != begin.astimezone().utcoffset():
        zone = begin.tzinfo
    found_clock = Clock(_utc(begin, zone), source, zone)
    if found_clock.is_doubtful:
        _log.warning("%s: may not begin %s; %s", path, found_clock, OVERRIDE)
    return found_clock


def _begin_by_name(
    path: Path, settings: Settings, tags: Tags, length: Fraction | None
) -> tuple[datetime, str] | None:
    """Return the start time by the name and metadata of a video, and which of them it is from."""
    clock, zone = settings.camera.clock, settings.camera.clock.zone
    images = numbered_images(path)
    named = written = None
    try:
        named = clock.time_in(images[0] if images else path)
    except ValueError as error:
        _log.warning("%s: %s; set camera.clock.pattern, with %%z for a zone", path, error)
        return None
    if clock.pattern and not named:
        raise ConfigError(f"{path}: its name does not match camera.clock.pattern, {clock.pattern}")
    with suppress(ValueError):
        written = parse_date_time(tags.creation_time or "")
    if not named:
        if not written:
            return None
        is_future = _utc(written, zone) > now() + _SAME
        return written, _FUTURE if is_future else _EXPORTED if tags.exporter else _CREATED
    if written and not clock.pattern:
        later = _utc(written, zone) - _utc(named, zone)
        if min(abs(later), abs(later - timedelta(seconds=float(length or 0)))) > _SAME:
            _log.warning(
                "%s: begins %s by its name, %s by its metadata; using the name; %s",
                path,
                *(_time_text(_utc(time, zone).astimezone(zone)) for time in (named, written)),
                OVERRIDE,
            )
    return named, "from its name"


def now() -> datetime:
    """Return the time, in UTC."""
    return datetime.now(UTC)


def _utc(time: datetime, zone: tzinfo | None) -> datetime:
    """Return a time in UTC; without a zone of its own it is local time in `zone`."""
    return (time if time.tzinfo or not zone else time.replace(tzinfo=zone)).astimezone(UTC)


def _time_text(time: datetime) -> str:
    return time.isoformat(" ", "seconds")


def add_frame(spans: list[Span], frame: FrameTracks, before: FrameTracks | None) -> None:
    """Extend the last span to a frame, or begin a new one if there is no video before it.

    `before` is the frame added last, None for the first one of a video. Frames in between may have
    been skipped.
    """
    frames = frame.index - before.index if before else 0
    extend(spans, round(frame.time, 6), _LONGEST_FRAME * frames if before else None)


def extend(spans: list[Span], time: float, gap: float | None) -> None:
    """Extend the last span to a later time if it is at most a gap later, or begin a new one."""
    if spans and gap is not None and time - spans[-1][1] <= gap:
        spans[-1] = spans[-1][0], time
    else:
        spans.append((time, time))


def joined(times: Iterable[float]) -> list[Span]:
    """Join ascending times that are close together into spans."""
    spans: list[Span] = []
    for time in times:
        extend(spans, time, GAP)
    return spans


def when(spans: Sequence[Span]) -> str:
    """Return "from 0:05 to 0:32"; for several spans, the longest and the number of others."""
    first, last = max(spans, key=lambda span: span[1] - span[0])
    more = f" (and {len(spans) - 1} more)" if len(spans) > 1 else ""
    return f"from {clock_text(int(first))} to {clock_text(int(last))}{more}"


def check_intervals(length: int | None, spans: Iterable[Span]) -> None:
    """Raise `ConfigError` if spans have too many intervals of a length, seconds."""
    if length and sum((last - first) // length + 1 for first, last in spans) > _MAX_COUNT:
        fault = f"{length} s makes more than {_MAX_COUNT:,} intervals"
        raise ConfigError(f"traffic.interval: {fault}; use a longer one")


@dataclass(frozen=True, slots=True)
class Interval:
    """An interval of a table.

    Attributes
    ----------
    number
        Its number, see `Intervals`.
    start, end
        Its limits, as they are shown.
    first, last
        Its part between the first and the last frame of all videos, seconds of `Intervals`.
    observed
        Seconds of it with video; once, where several videos have the same times.
    is_part
        Whether there is no video in more than a second of it.
    """

    number: int
    start: ClockTime
    end: ClockTime
    first: float
    last: float
    observed: float
    is_part: bool


class Intervals:
    """The numbered intervals of one or several videos that contain video.

    With a clock, they begin at round local times of the day, also after a change of the offset. The
    number of an interval is its start. Internally, seconds are those of the video, of the clock
    since 1970, or of several videos without clocks one after another.

    Parameters
    ----------
    videos
        The clock and the spans of each video.
    length
        Seconds; None for a single interval.

    Attributes
    ----------
    periods
        The intervals, in order.

    Raises
    ------
    ConfigError
        `length` is set, and one of several videos has no clock, or there are too many intervals.
    """

    def __init__(
        self, videos: Sequence[tuple[Clock | None, Sequence[Span]]], length: int | None
    ) -> None:
        self._length = length
        self._is_timed = len(videos) == 1
        self._zone: tzinfo | None = None
        clocks = [clock for clock, _ in videos if clock]
        self._has_clock = 0 < len(clocks) == len(videos)
        if self._has_clock:
            self._zone = clocks[0].zone
            self._zeros = [(clock.zero - _EPOCH).total_seconds() for clock in clocks]
        elif self._is_timed:
            self._zeros = [0.0]
        elif length is None:  # one after another
            ends = accumulate(spans[-1][1] - spans[0][0] for _, spans in videos)
            self._zeros = [end - spans[-1][1] for end, (_, spans) in zip(ends, videos, strict=True)]
        else:
            message = "intervals over several videos need the time at which each begins"
            raise ConfigError(f"{message}; set input.begin")
        self._spans = [
            [(zero + first, zero + last) for first, last in spans]
            for zero, (_, spans) in zip(self._zeros, videos, strict=True)
        ]
        self._every = [span for spans in self._spans for span in spans]
        self._observed: list[Span] = []
        for first, last in sorted(self._every):
            if self._observed and first - self._observed[-1][1] <= SEAM:
                begin, end = self._observed.pop()
                first, last = begin, max(end, last)  # noqa: PLW2901
            self._observed.append((first, last))
        self._first = min(first for first, _ in self._every)
        self._last = max(last for _, last in self._every)
        check_intervals(length, self._every)
        numbers: set[int] = set()
        for first, last in self._every:
            number = self.number_at(first)
            numbers.add(number)
            while length and (number := self._end(number)) <= last:
                numbers.add(number)
        self.periods = tuple(map(self._interval, sorted(numbers)))

    def seconds(self, index: int, time: float) -> float:
        """Convert a time in one of the videos to the seconds of the intervals.

        The time of an event may be slightly before or after the frames: the nearest one is used.
        """
        seconds, spans = self._zeros[index] + time, self._spans[index]
        first, last = next((span for span in reversed(spans) if span[0] <= seconds), spans[0])
        return min(max(seconds, first), last)

    def number(self, index: int, time: float) -> int:
        """Return the number of the interval of a time in one of the videos."""
        return self.number_at(self.seconds(index, time))

    def number_at(self, seconds: float) -> int:
        """Return the number of the interval of `seconds`: its start."""
        if self._length is None:
            return 0
        offset = self._offset(seconds)
        round_time = (seconds + offset) // self._length * self._length
        start = int(round_time - offset)
        return start if self._offset(start) == offset else self._at_local(round_time)

    def _end(self, number: int) -> int:
        """Return the end of an interval, which is the number of the next one."""
        assert self._length is not None
        end = number + self._length
        if self.number_at(end) == end:
            return end
        round_time = (number + self._offset(number)) // self._length * self._length
        return self._at_local(round_time + self._length)

    def _offset(self, seconds: float) -> float:
        """Return the offset of local time from UTC at a moment, seconds; 0 without a clock."""
        if not self._has_clock:
            return 0.0
        time = (_EPOCH + timedelta(seconds=seconds)).astimezone(self._zone)
        return (time.utcoffset() or timedelta()).total_seconds()

    def _at_local(self, seconds: float) -> int:
        """Return the first moment of a local time, both in seconds since 1970."""
        time = datetime(1970, 1, 1) + timedelta(seconds=seconds)
        time = time.replace(tzinfo=self._zone) if self._zone else time.astimezone()
        return int((time - _EPOCH).total_seconds())

    def start_in(self, index: int, number: int) -> float:
        """Return the start of an interval of some length, in the time of one of the videos."""
        return round(number - self._zeros[index], 3)

    def _interval(self, number: int) -> Interval:
        start, end = self._first, self._last
        if self._length is not None:
            start, end = float(number), float(self._end(number))
        common = (min(end, b) - max(start, a) for a, b in self._observed)
        observed = sum(seconds for seconds in common if seconds > 0)
        return Interval(
            number=number,
            start=self._clock_time(start),
            end=self._clock_time(end),
            first=max(start, self._first),
            last=min(end, self._last),
            observed=round(observed, 3),
            is_part=observed < end - start - 1,
        )

    @property
    def to_clock(self) -> Callable[[float], datetime] | None:
        """Converts seconds to clock times; None if these are unknown."""
        return Clock(_EPOCH, "", self._zone).at if self._has_clock else None

    def _clock_time(self, seconds: float) -> ClockTime:
        if to_clock := self.to_clock:
            return to_clock(round(seconds, 3))
        return round(seconds, 3) if self._is_timed else None
