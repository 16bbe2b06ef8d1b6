"""Count in saved tracks of one video, or of several that may follow one another in time."""

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

from vdet.config.schema import Settings
from vdet.errors import ConfigError, TruthError
from vdet.labels.label import SavedTracks
from vdet.labels.reading import read_tracks
from vdet.lanes.ground import ground_of
from vdet.progress import Advance
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Clock, Span, find_clock
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.counts import Counts, Event
from vdet.traffic.speeds import SpeedMeter, with_speeds

_SEAM = 2.0
"""Maximum seconds between the end of a video and the start of the one that continues it: times in
names and containers are whole seconds.
"""
_STEP = 0.04
"""Assumed seconds from the last frame before a seam to the first one after it."""


def count_files(
    paths: Sequence[Path],
    settings: Settings,
    size: tuple[int, int] | None = None,
    rate: float | None = None,
    *,
    advance: Advance = lambda _: None,
) -> dict[str, Counts]:
    """Count the vehicles of files of tracks at the lines and in the zones of the settings.

    A file that follows the previous one, by their clocks, is counted together with it: a vehicle in
    both is one vehicle. Other files are counted separately.

    Parameters
    ----------
    size
        Width and height of the frames, pixels; None: from the file, else from `camera.size`.
    rate
        Frames per second, for a file without times.
    advance
        Called after each file with 1.

    Returns
    -------
    The counts of each file. No two vehicles have the same number, in all files.

    Raises
    ------
    TruthError
        A file cannot be used, or its times are missing or wrong.
    ConfigError
        The lines do not fit the frames, the size of the frames is unknown, a name does not match
        the pattern of the clock, or no file needs the `rate`.
    """
    counted: dict[str, Counts] = {}
    group: _Group | None = None
    rate_is_used = rate is None
    recording = _Recording(settings)
    for path in paths:
        saved = read_tracks(path)
        if not saved.has_times:
            if rate is None:
                raise TruthError(f"{path}: has no times; pass the frame rate, as in --rate 25")
            saved, rate_is_used = saved.at_rate(rate), True
        clock = find_clock(path, settings, saved.times.get(0, 0.0), saved=saved)
        if clock and settings.input.begin and len(paths) > 1:
            clock = recording.next_clock(path, saved, clock)
        frame_size = _frame_size(settings, size or saved.size)
        first = min(saved.times.values(), default=None)
        if group is None or not group.precedes(frame_size, clock, first):
            counted |= group.counts() if group else {}
            group = _Group(settings, frame_size, group.counter.linker.started if group else 0)
        group.add(str(path), clock, first or 0.0, saved)
        advance(1)
    if not rate_is_used:
        raise ConfigError("--rate changes nothing: the tracks have times; remove it")
    return counted | (group.counts() if group else {})


def count_frames(
    frames: Iterable[FrameTracks], settings: Settings, size: tuple[int, int] | None = None
) -> Counts:
    """Count the vehicles in the tracks of each frame; arguments and errors as for `count_files`."""
    group = _Group(settings, _frame_size(settings, size))
    group.add("", None, 0.0, frames)
    return group.counts()[""]


def _frame_size(settings: Settings, size: tuple[int, int] | None) -> tuple[int, int]:
    if not settings.traffic:
        raise ConfigError("no lines or zones to count at; add them to the settings")
    if size := size or settings.camera.size:
        return size
    raise ConfigError("the lines are fractions of the frame; pass --size, such as 1280x720")


class _Recording:
    """The files of one recording, of which `input.begin` is the start."""

    def __init__(self, settings: Settings) -> None:
        own_input = settings.input.model_copy(update={"begin": None})
        self._settings = settings.model_copy(update={"input": own_input})
        self._offset: timedelta | None = None
        self._has_begun = False
        self._end: datetime | None = None

    def next_clock(self, path: Path, saved: SavedTracks, begin: Clock) -> Clock:
        """Return the clock of the next file; `begin` is its clock if it is the first.

        The clock of its own is set right as that of the first file; without one it begins at the
        end of the file before. Raises `TruthError` if that is unknown.
        """
        own, clock = find_clock(path, self._settings, begin.first, saved=saved), begin
        if own and not self._has_begun:
            self._offset = begin.zero - own.zero
        if own and self._offset is not None:
            clock = replace(begin, zero=own.zero + self._offset)
        elif self._has_begun:
            if self._end is None:
                fault = "the file before does not say how long its video is; use .jsonl tracks"
                raise TruthError(f"{path}: has no clock, and {fault}")
            clock = replace(begin, zero=begin.zero + (self._end - begin.at(begin.first)))
        self._has_begun, self._end = True, None
        if saved.covered:
            first, last = saved.times[saved.covered[0]], saved.times[saved.covered[-1]]
            self._end = clock.at(last + (last - first) / max(1, len(saved.covered) - 1))
        return clock


@dataclass(frozen=True, slots=True)
class _Video:
    """A video of a group.

    `spans` as in `Counts`; `shift` converts its times to those of the group.
    """

    name: str
    clock: Clock | None
    spans: tuple[Span, ...]
    shift: float
    meter: SpeedMeter | None

    @property
    def end(self) -> float:
        """When it ends in the group, seconds."""
        return self.spans[-1][1] + self.shift

    def unshifted(self, event: Event) -> Event:
        """Return an event of the group at its time in this video."""
        return replace(event, time=round(event.time - self.shift, 3))


class _Group:
    """Videos that follow one another, with one counter."""

    def __init__(self, settings: Settings, size: tuple[int, int], started: int = 0) -> None:
        self._size = size
        self._ground = ground_of(settings.camera, *size)
        self.counter = VehicleCounter(settings, *size, started)
        self._videos: list[_Video] = []

    def precedes(self, size: tuple[int, int], clock: Clock | None, first: float | None) -> bool:
        """Return whether a video follows the last one; `first` is the time of its first frame."""
        before = self._videos[-1]
        if not (clock and before.clock and first is not None and size == self._size):
            return False
        gap = clock.at(first) - before.clock.at(before.spans[-1][1])
        return gap.total_seconds() >= -_SEAM

    def add(
        self, name: str, clock: Clock | None, first: float, frames: Iterable[FrameTracks]
    ) -> None:
        """Count in the next video; `first` is the time of its first frame."""
        shift = self._shift(clock, first)
        meter = SpeedMeter(self._ground, *self._size) if self._ground else None
        if self._videos:
            self.counter.start_video()
        span_count, latest = len(self.counter.spans), -math.inf
        for frame in frames:
            if not latest <= frame.time < math.inf:
                raise TruthError(
                    f"frame {frame.index}: {frame.time:g} s is before {latest:g} s; times must "
                    "increase"
                )
            latest = frame.time
            self.counter.update(replace(frame, time=latest + shift) if shift else frame)
            if meter:
                meter.add(frame)
        new = self.counter.spans[span_count:] or [(first + shift, first + shift)]
        spans = tuple((round(begin - shift, 6), round(end - shift, 6)) for begin, end in new)
        self._videos.append(_Video(name, clock, spans, shift, meter))

    def _shift(self, clock: Clock | None, first: float) -> float:
        """Return the seconds from the times of the next video to those of the group."""
        if not self._videos:
            return 0.0
        shift, begin, end = 0.0, self._videos[0].clock, self._videos[-1].end
        if clock and begin:
            shift = (clock.zero - begin.zero).total_seconds()
        return shift if first + shift - end >= _SEAM else end + _STEP - first

    def counts(self) -> dict[str, Counts]:
        """Return the counts of each video, with times in that video."""
        total = self.counter.counts()
        times = [event.time for event in total.events]
        counts: dict[str, Counts] = {}
        first = 0
        for video in self._videos:
            is_last = video is self._videos[-1]
            end = len(times) if is_last else bisect_right(times, video.end)
            counts[video.name] = with_speeds(
                replace(
                    total,
                    events=tuple(map(video.unshifted, total.events[first:end])),
                    spans=video.spans,
                    clock=video.clock,
                    warnings=() if counts else total.warnings,  # reported once
                ),
                video.meter,
            )
            first = end
        return counts
