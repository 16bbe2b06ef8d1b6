"""Count in saved tracks of one video, or of several that may follow one another in time."""

import logging
import math
import re
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from itertools import zip_longest
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

_log = logging.getLogger("vdet")

_SEAM = 1.0
"""Maximum seconds between two videos that continue without a gap, if a clock has whole seconds."""
_MIN_GAP = 0.1
"""Minimum seconds of a gap by two clocks with fractions of a second, and of an overlap."""
_STEP = 0.04
"""Assumed duration of the only frame of a video, seconds."""
_REPEATED = 11.0
"""Last seconds of a video that are looked for in the next one."""
_SAME = 0.1
"""Maximum distance of vehicles in the same frame of two videos, in heights of their boxes."""
_DATES = tuple(
    map(re.compile, (r"(19|20)\d\d[-_.]?[01]\d[-_.]?[0-3]\d", r"(\d{1,2}\D{1,2}){4}\d", r"\d{4}"))
)
"""Start of the time or counter in the name of a file; the name of the camera precedes it."""
_COUNTER = re.compile(r"(?<![a-zA-Z\d])\d+|(?<=\d[a-zA-Z])\d+|\d{4,}")
"""Digits that differ between videos of one camera, unlike those of a word such as cam1."""


def camera_of(path: Path) -> tuple[str, ...]:
    """Return the parts of a path without times and counters; they are equal for one camera."""
    folders = (_without_counters(folder, _DATES[:1]) for folder in path.parent.parts)
    return *folders, _without_counters(path.name, _DATES)


def _without_counters(name: str, dates: Iterable[re.Pattern[str]]) -> str:
    date = next(filter(None, (date.search(name) for date in dates)), None)
    return name[: date.start()] + _COUNTER.sub("#", name[date.start() :]) if date else name


def count_files(
    paths: Sequence[Path],
    settings: Settings,
    size: tuple[int, int] | None = None,
    rate: float | None = None,
    *,
    advance: Advance = lambda _: None,
) -> dict[str, Counts]:
    """Count the vehicles of files of tracks at the lines and in the zones of the settings.

    A file that follows another of the same camera, by their names and clocks, is counted together
    with it: a vehicle in both is one vehicle. Where they overlap, the frames of the earlier file
    count, with a warning (logger "vdet"). Other files are counted separately.

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
    for path in sorted(dict.fromkeys(paths), key=camera_of):
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
        if group is None or not group.precedes(path, frame_size, clock, first):
            counted |= group.counts() if group else {}
            group = _Group(settings, frame_size, group.counter.linker.started if group else 0)
        group.add(str(path), clock, first or 0.0, saved)
        advance(1)
    if not rate_is_used:
        raise ConfigError("--rate changes nothing: the tracks have times; remove it")
    counted |= group.counts() if group else {}
    return {str(path): counted[str(path)] for path in paths}


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

    `spans` as in `Counts`; `shift` and `frame_shift` convert its times and the numbers of its
    frames to those of the group. `end` is the end of its last frame, seconds; `last_frames` are
    those of its last seconds.
    """

    name: str
    clock: Clock | None
    spans: tuple[Span, ...]
    end: float
    shift: float
    frame_shift: int
    meter: SpeedMeter | None
    last_frames: Sequence[FrameTracks]

    def repeated_seconds(
        self, first: float, frames: Iterable[FrameTracks], overlap: float
    ) -> float:
        """Return the seconds at its end that the next video shows again; 0 if that is unclear.

        `first` is the time of the first of its frames, `overlap` that by the clocks.
        """
        start = next((frame for frame in frames if frame.tracks), None)
        if not start or start.time - first > _SEAM:
            return 0.0
        end = self.end + start.time - first
        before = [f for f in self.last_frames if abs(end - f.time - overlap) <= _SEAM + 1e-6]

        def distance(frame: FrameTracks) -> float:
            feet = [track.foot for track in frame.tracks]
            nearest = (
                min((math.dist(track.foot, foot) for foot in feet), default=math.inf)
                / track.box.height
                for track in start.tracks
            )
            return max(nearest)

        same = min(reversed(before), key=distance, default=None)
        if not same or distance(same) > _SAME:
            return 0.0
        has_moved = distance(self.last_frames[-1]) > distance(same) + 2 * _SAME
        return end - same.time if has_moved else 0.0

    def unshifted(self, event: Event) -> Event:
        """Return an event of the group at its time and frame in this video."""
        time, frame = round(event.time - self.shift, 3), event.frame - self.frame_shift
        return replace(event, time=time, frame=frame)


class _Group:
    """Videos that follow one another, with one counter."""

    def __init__(self, settings: Settings, size: tuple[int, int], started: int = 0) -> None:
        self._size = size
        self._ground = ground_of(settings.camera, *size)
        self.counter = VehicleCounter(settings, *size, started)
        self._videos: list[_Video] = []
        self._frame_count = 0  # number of the last frame in the group, and 1

    def precedes(
        self, path: Path, size: tuple[int, int], clock: Clock | None, first: float | None
    ) -> bool:
        """Return whether a video follows the last one; `first` is the time of its first frame."""
        before = self._videos[-1]
        if not (clock and before.clock and first is not None and size == self._size):
            return False
        is_later = clock.at(first) >= before.clock.at(before.spans[0][0])
        return is_later and camera_of(path) == camera_of(Path(before.name))

    def add(
        self, name: str, clock: Clock | None, first: float, frames: Iterable[FrameTracks]
    ) -> None:
        """Count in the next video; `first` is the time of its first frame."""
        gap = self._gap(clock, first, frames)
        shift = self._videos[-1].end + self._videos[-1].shift + gap - first if self._videos else 0.0
        start = first - gap if gap < 0 else -math.inf
        if gap < 0:
            _log.warning(
                "%s: begins %.1f s before the end of %s; these frames are not counted again; if "
                "its clock is wrong, count it on its own",
                name,
                -gap,
                self._videos[-1].name,
            )
        meter = SpeedMeter(self._ground, *self._size) if self._ground else None
        if self._videos:
            self.counter.start_video()
        span_count, latest, last_index = len(self.counter.spans), -math.inf, 0
        frame_shift, last_frames, step = self._frame_count, deque[FrameTracks](), _STEP
        for frame in frames:
            if not latest <= frame.time < math.inf:
                raise TruthError(
                    f"frame {frame.index}: {frame.time:g} s is before {latest:g} s; times must "
                    "increase"
                )
            if latest > -math.inf:
                step = (frame.time - latest) / max(1, frame.index - last_index)
            latest, last_index = frame.time, frame.index
            if latest < start:
                continue
            index = frame.index + frame_shift
            self._frame_count = index + 1
            self.counter.update(replace(frame, index=index, time=latest + shift))
            if meter:
                meter.add(frame)
            last_frames.append(frame)
            while latest - last_frames[0].time > _REPEATED:
                last_frames.popleft()
        new = self.counter.spans[span_count:] or [(first + shift, first + shift)]
        spans = tuple((round(begin - shift, 6), round(end - shift, 6)) for begin, end in new)
        video = _Video(
            name=name,
            clock=clock,
            spans=spans,
            end=max(start, spans[-1][1] + min(step, _SEAM)),
            shift=shift,
            frame_shift=frame_shift,
            meter=meter,
            last_frames=last_frames,
        )
        self._videos.append(video)

    def _gap(self, clock: Clock | None, first: float, frames: Iterable[FrameTracks]) -> float:
        """Return the seconds from the end of the last video to the next; negative if they overlap.

        Clocks with whole seconds do not measure small gaps; vehicles show small overlaps.
        """
        before = self._videos[-1] if self._videos else None
        if not (before and before.clock and clock):
            return 0.0
        gap = (clock.at(first) - before.clock.at(before.end)).total_seconds()
        has_seconds = before.clock.has_whole_seconds or clock.has_whole_seconds
        repeated = before.repeated_seconds(first, frames, -gap) if has_seconds else 0.0
        if repeated >= _MIN_GAP:
            return -repeated
        return 0.0 if abs(gap) <= (_SEAM + 1e-6 if has_seconds else _MIN_GAP) else gap

    def counts(self) -> dict[str, Counts]:
        """Return the counts of each video, with times in that video."""
        total = self.counter.counts()
        counts: dict[str, Counts] = {}
        for video, following in zip_longest(self._videos, self._videos[1:]):
            end = following.frame_shift if following else math.inf
            events = (e for e in total.events if video.frame_shift <= e.frame < end)
            counts[video.name] = with_speeds(
                replace(
                    total,
                    events=tuple(map(video.unshifted, events)),
                    spans=video.spans,
                    clock=video.clock,
                    warnings=() if counts else total.warnings,  # reported once
                ),
                video.meter,
            )
        return counts
