"""Count in saved tracks of one video, or of several that may follow one another in time."""

import logging
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from functools import partial
from pathlib import Path

from vdet.config.schema import Settings
from vdet.errors import ConfigError, TruthError
from vdet.findings import Finding
from vdet.labels.label import SavedTracks
from vdet.labels.reading import read_tracks
from vdet.lanes.ground import ground_of
from vdet.progress import Advance
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Clock, Span, find_clock
from vdet.traffic.corrections import Corrections, apply_corrections, by_video
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.counts import Counts
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
_ROUNDING = 1e-6
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
    corrections: Sequence[Corrections] = (),
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
    corrections
        Those of videos that are counted, one for each video at most.
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
        the pattern of the clock, or no file needs the `rate`; the corrections do not fit.
    """
    counted: dict[str, Counts] = {}
    names: dict[str, str | None] = {}
    group: _Group | None = None
    rate_is_used = rate is None
    recording = _Recording(settings)
    for path in sorted(dict.fromkeys(paths), key=camera_of):
        saved = read_tracks(path, size=size)
        if not saved.has_times:
            if rate is None:
                raise TruthError(f"{path}: has no times; pass the frame rate, as in --rate 25")
            saved, rate_is_used = saved.at_rate(rate), True
        clock = find_clock(path, settings, saved.times.get(0, 0.0), saved=saved)
        if clock and settings.input.begin and len(paths) > 1:
            clock = recording.next_clock(path, saved, clock, group.last if group else None)
        frame_size = _frame_size(settings, size or saved.size)
        first, is_complete = saved.first_time, saved.covered is not None
        video = _Video(str(path), clock, first, is_complete, saved.findings)
        if group is None or not group.precedes(video, frame_size):
            counted |= group.counts() if group else {}
            started = group.counter.linker.started if group else 0
            group = _Group(_all_classes(settings, corrections), frame_size, started)
        names[video.name] = saved.video.name if saved.video else None
        group.add(video, saved)
        if clock:  # else no file follows it
            video.last_frames = _last_frames(saved)
        advance(1)
    if not rate_is_used:
        raise ConfigError("--rate changes nothing: the tracks have times; remove it")
    counted |= group.counts() if group else {}
    reviews = by_video(corrections, names, settings.traffic)
    counted = apply_corrections(counted, reviews, settings.classes)
    return {str(path): counted[str(path)] for path in paths}


def count_frames(
    frames: Iterable[FrameTracks],
    settings: Settings,
    size: tuple[int, int] | None = None,
    *,
    corrections: Sequence[Corrections] = (),
    name: str | None = None,
) -> Counts:
    """Count the vehicles in the tracks of each frame; arguments and errors as for `count_files`.

    `name` is that of the video, for the corrections; None if unknown.
    """
    frame_size = _frame_size(settings, size)
    group = _Group(_all_classes(settings, corrections), frame_size)
    reviews = by_video(corrections, {"": name}, settings.traffic)
    group.add(_Video(""), frames)
    return apply_corrections(group.counts(), reviews, settings.classes)[""]


def _all_classes(settings: Settings, corrections: Sequence[Corrections]) -> Settings:
    """Return settings without a selection of classes if there are corrections, of any class."""
    return settings.model_copy(update={"classes": ()}) if corrections else settings


def _frame_size(settings: Settings, size: tuple[int, int] | None) -> tuple[int, int]:
    if not settings.traffic:
        raise ConfigError("no lines or zones to count at; add them to the settings")
    if size := size or settings.camera.size:
        return size
    raise ConfigError("the lines are fractions of the frame; pass --size, such as 1280x720")


@dataclass(slots=True)
class _Video:
    """A video of a group; times are seconds of its own.

    Attributes
    ----------
    first, start
        Times of its first frame, and from which on frames count.
    is_complete
        Whether its last frame is known, also without a vehicle.
    findings
        As in `Counts`.
    shift, frame_shift
        What converts its times and the numbers of its frames to those of the group.
    spans
        As in `Counts`.
    end, next_shift
        The end of its last frame, and the `frame_shift` of the video after it.
    last_frames
        The frames of its last seconds, if it has a clock.
    """

    name: str
    clock: Clock | None = None
    first: float = 0.0
    is_complete: bool = True
    findings: tuple[Finding, ...] = ()
    meter: SpeedMeter | None = None
    start: float = -math.inf
    shift: float = 0.0
    frame_shift: int = 0
    spans: tuple[Span, ...] = ()
    end: float = 0.0
    next_shift: int = 0
    last_frames: Sequence[FrameTracks] = ()

    def counts(self, group: Counts) -> Counts:
        """Return those of its group that are of this video, at its times and frames."""
        events = (
            replace(
                event,
                time=round(event.time - self.shift, 3),
                frame=event.frame - self.frame_shift,
            )
            for event in group.events
            if self.frame_shift <= event.frame < self.next_shift
        )
        spans = self.spans or ((self.first, self.first),)
        of_video = replace(
            group, events=tuple(events), spans=spans, clock=self.clock, findings=self.findings
        )
        return with_speeds(of_video, self.meter)


class _Recording:
    """The clocks of the files of one recording, of which `input.begin` is the start."""

    def __init__(self, settings: Settings) -> None:
        own_input = settings.input.model_copy(update={"begin": None})
        self._settings = settings.model_copy(update={"input": own_input})
        self._offset: timedelta | None = None

    def next_clock(
        self, path: Path, saved: SavedTracks, begin: Clock, before: _Video | None
    ) -> Clock:
        """Return the clock of the file after `before`; `begin` is that of the first.

        The clock of its own is set right as that of the first file; without one it begins at the
        end of the file before. Raises `TruthError` if that is unknown.
        """
        own = find_clock(path, self._settings, begin.first, saved=saved)
        if before is None or before.clock is None:
            self._offset = begin.zero - own.zero if own else None
            return begin
        if own and self._offset is not None:
            return replace(begin, zero=own.zero + self._offset)
        if not before.is_complete:
            fault = "the file before does not say how long its video is; use .jsonl tracks"
            raise TruthError(f"{path}: has no clock, and {fault}")
        later = before.clock.at(before.end) - begin.at(begin.first)
        return replace(begin, zero=begin.zero + later)


class _Group:
    """Videos that follow one another, with one counter."""

    def __init__(self, settings: Settings, size: tuple[int, int], started: int = 0) -> None:
        self._size = size
        self._ground = ground_of(settings.camera, *size)
        self.counter = VehicleCounter(settings, *size, started)
        self._videos: list[_Video] = []

    @property
    def last(self) -> _Video | None:
        """Its last video."""
        return self._videos[-1] if self._videos else None

    def precedes(self, video: _Video, size: tuple[int, int]) -> bool:
        """Return whether a video with frames of a size follows the last one of the group."""
        before = self.last
        if not (before and before.clock and video.clock) or size != self._size:
            return False
        is_later = video.clock.at(video.first) >= before.clock.at(before.first)
        return is_later and camera_of(Path(video.name)) == camera_of(Path(before.name))

    def add(self, video: _Video, frames: Iterable[FrameTracks]) -> None:
        """Count in the next video."""
        if self._ground:
            video.meter = SpeedMeter(self._ground, *self._size)
        if self.last:
            self._continue(self.last, video, frames)
        self._videos.append(video)
        latest: FrameTracks | None = None
        first_span, step = len(self.counter.spans), _STEP
        for frame in frames:
            before = latest or frame
            if not before.time <= frame.time < math.inf:
                raise TruthError(
                    f"frame {frame.index}: {frame.time:g} s is before {before.time:g} s; times "
                    "must increase"
                )
            if latest:
                step = (frame.time - latest.time) / max(1, frame.index - latest.index)
            latest = frame
            if frame.time >= video.start:
                index, time = frame.index + video.frame_shift, frame.time + video.shift
                self.counter.update(FrameTracks(index, time, frame.tracks))
                if video.meter:
                    video.meter.add(frame)
        last = round(latest.time, 6) if latest else video.first
        video.end = max(video.start, last + min(step, _SEAM))
        video.next_shift = video.frame_shift + (latest.index + 1 if latest else 0)
        video.spans = tuple(
            (round(first - video.shift, 6), round(last - video.shift, 6))
            for first, last in self.counter.spans[first_span:]
        )

    def _continue(self, before: _Video, video: _Video, frames: Iterable[FrameTracks]) -> None:
        """Let a video follow the one before."""
        gap = _gap(before, video, frames)
        if gap < 0:
            video.start = video.first - gap
            _log.warning(
                "%s: begins %.1f s before the end of %s; these frames are not counted again; if "
                "its clock is wrong, count it on its own",
                video.name,
                -gap,
                before.name,
            )
        video.shift = round(before.shift + before.end + gap - video.first, 6)
        video.frame_shift = before.next_shift
        self.counter.start_video()

    def counts(self) -> dict[str, Counts]:
        """Return the counts of each video, with times in that video."""
        group = self.counter.counts()
        counts = {video.name: video.counts(group) for video in self._videos}
        for video in self._videos[1:]:  # the warnings are those of the group
            counts[video.name] = replace(counts[video.name], warnings=())
        return counts


def _last_frames(saved: SavedTracks) -> list[FrameTracks]:
    """Return the frames of the last `_REPEATED` seconds."""
    start = max(saved.times.values(), default=0.0) - _REPEATED
    labels = (label for label in saved.labels if saved.times[label.frame - 1] >= start)
    covered = [index for index in saved.covered or () if saved.times[index] >= start]
    return list(replace(saved, labels=tuple(labels), covered=covered))


def _gap(before: _Video, video: _Video, frames: Iterable[FrameTracks]) -> float:
    """Return the seconds from the end of a video to the next; negative if they overlap.

    Clocks with whole seconds do not measure small gaps; vehicles show small overlaps.
    """
    if not (before.clock and video.clock):
        return 0.0
    gap = (video.clock.at(video.first) - before.clock.at(before.end)).total_seconds()
    if not (before.clock.has_whole_seconds or video.clock.has_whole_seconds):
        return gap if abs(gap) > _MIN_GAP else 0.0
    repeated = _repeated_seconds(before, video.first, frames, -gap)
    if repeated >= _MIN_GAP:
        return -repeated
    return gap if abs(gap) > _SEAM + _ROUNDING else 0.0


def _repeated_seconds(
    before: _Video, first: float, frames: Iterable[FrameTracks], overlap: float
) -> float:
    """Return the seconds at the end of a video that the next one shows again; 0 if unclear.

    `first` is the time of the first of its frames, `overlap` that by the clocks.
    """
    start = next((frame for frame in frames if frame.tracks), None)
    if not start or start.time - first > _SEAM:
        return 0.0
    distance, end = partial(_distance, start), before.end + start.time - first
    candidates = (
        frame
        for frame in reversed(before.last_frames)
        if abs(end - frame.time - overlap) <= _SEAM + _ROUNDING
    )
    same = min(candidates, key=distance, default=None)
    if not same or distance(same) > _SAME:
        return 0.0
    has_moved = distance(before.last_frames[-1]) > distance(same) + 2 * _SAME
    return end - same.time if has_moved else 0.0


def _distance(frame: FrameTracks, other: FrameTracks) -> float:
    """Return the maximum distance of a vehicle to the nearest of another frame, in heights."""
    return max(
        min((math.dist(track.foot, near.foot) for near in other.tracks), default=math.inf)
        / track.box.height
        for track in frame.tracks
    )
