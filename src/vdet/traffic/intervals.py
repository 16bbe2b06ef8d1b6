"""The intervals of tables and of pages: parts of the time of one or several videos."""

from collections.abc import Sequence
from datetime import datetime, timedelta, timezone, tzinfo
from itertools import accumulate

from vdet.errors import ConfigError
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Clock

Span = tuple[float, float]
"""From when to when there is video: times of the first and the last frame, seconds."""

Moment = datetime | float | None
"""The moment on the clock; seconds in a video without; None in several without."""

_LONGEST_FRAME = 60.0
"""Seconds for which a frame is shown at most; until a later one there is no video."""


def add_frame(spans: list[Span], frame: FrameTracks, before: FrameTracks | None) -> None:
    """Let the last span end with a frame, or begin another where there is no video before it.

    `before` is the last frame that was added, None for the first one of a video. Frames between may
    have been left out.
    """
    time = round(frame.time, 6)
    frames = frame.index - before.index if before else 0
    if frames and time - spans[-1][1] <= _LONGEST_FRAME * frames:
        spans[-1] = spans[-1][0], time
    else:
        spans.append((time, time))


class Intervals:
    """The intervals of one or several videos in which there is video, by their numbers.

    With a clock, they begin at round times of the day. Inside, seconds are those of the video, of
    the clock's local time since 1970, or of several videos without clocks one after the other.

    Parameters
    ----------
    videos
        The clock and the spans of each video.
    length
        Seconds; None for one interval over all.

    Raises
    ------
    ConfigError
        There are intervals, and several videos of which one has no clock.
    """

    def __init__(
        self, videos: Sequence[tuple[Clock | None, Sequence[Span]]], length: int | None
    ) -> None:
        self._length = length
        self._origin: datetime | None = None
        self._zone: tzinfo | None = None
        self._is_timed = True
        self._zeros = [0.0]
        clocks = [clock for clock, _ in videos if clock]
        if clocks and len(clocks) == len(videos):
            first = clocks[0].at(clocks[0].first)
            self._origin = datetime(1970, 1, 1, tzinfo=timezone(first.utcoffset() or timedelta()))
            self._zone = clocks[0].zone
            self._zeros = [(clock.zero - self._origin).total_seconds() for clock in clocks]
        elif len(videos) > 1:
            if length is not None:
                raise ConfigError(
                    "intervals over several videos need the time at which each begins; pass --begin"
                )
            self._is_timed = False
            ends = accumulate(spans[-1][1] - spans[0][0] for _, spans in videos)
            self._zeros = [end - spans[-1][1] for end, (_, spans) in zip(ends, videos, strict=True)]
        self._spans = [
            [(zero + first, zero + last) for first, last in spans]
            for zero, (_, spans) in zip(self._zeros, videos, strict=True)
        ]
        every = [span for spans in self._spans for span in spans]
        self._first, self._last = min(first for first, _ in every), max(last for _, last in every)
        ranges = [(self.number_at(first), self.number_at(last)) for first, last in every]
        self.numbers = sorted({n for first, last in ranges for n in range(first, last + 1)})

    def seconds(self, which: int, time: float) -> float:
        """Return a time in one of the videos in the seconds of the intervals.

        The time of an event may be a little before or after the frames: it is that of the nearest.
        """
        seconds, spans = self._zeros[which] + time, self._spans[which]
        first, last = next((span for span in reversed(spans) if span[0] <= seconds), spans[0])
        return min(max(seconds, first), last)

    def number(self, which: int, time: float) -> int:
        """Return the number of the interval of a time in one of the videos."""
        return self.number_at(self.seconds(which, time))

    def number_at(self, seconds: float) -> int:
        """Return the number of the interval of `seconds`."""
        return 0 if self._length is None else int(seconds // self._length)

    def limits(self, number: int) -> Span:
        """Return the part of an interval between the first and the last frame of all videos."""
        if self._length is None:
            return self._first, self._last
        begin = number * self._length
        return max(begin, self._first), min(begin + self._length, self._last)

    def start_in(self, which: int, number: int) -> float:
        """Return when an interval begins, in the time of one of the videos."""
        begin = self._first if self._length is None else number * self._length
        return round(begin - self._zeros[which], 3)

    def covered(self, number: int) -> float:
        """Return the seconds of video in an interval."""
        begin, end = self.limits(number)
        every = [span for spans in self._spans for span in spans]
        return sum(max(0.0, min(end, last) - max(begin, first)) for first, last in every)

    def moments(self, number: int) -> tuple[Moment, Moment]:
        """Return the start and the end of an interval."""
        start, end = self._first, self._last
        if self._length is not None:
            start, end = (float(item * self._length) for item in (number, number + 1))
        return self._moment(start), self._moment(end)

    def _moment(self, seconds: float) -> Moment:
        if self._origin:
            found = self._origin + timedelta(milliseconds=round(1000 * seconds))
            return found.astimezone(self._zone)
        return round(seconds, 3) if self._is_timed else None
