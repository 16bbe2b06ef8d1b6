"""Count in saved tracks of one video, or of several of one camera that may follow one another.

Which part of a video the next one shows again is seen by the vehicles in both. Clocks say how long
two videos overlap, but most have whole seconds. Vehicles that move say it to a frame: the next
video is laid over the end of the one before at each time that the clocks allow, and where the
vehicles of both are nearest, it begins.
"""

import logging
import math
import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, timedelta
from pathlib import Path

import numpy as np

from vdet.boxes import Float64Array
from vdet.config.classes import standard_class
from vdet.config.schema import Settings
from vdet.errors import ConfigError, TruthError
from vdet.findings import Finding, at_places, with_counted, without
from vdet.labels.label import SavedTracks, SourceVideo
from vdet.labels.reading import read_head, read_tracks
from vdet.lanes.camera import ground_of
from vdet.regions import Regions
from vdet.track.track import FrameTracks
from vdet.traffic.clock import SEAM, Clock, Span, find_clock
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.counts import Counts
from vdet.traffic.speeds import SpeedMeter, with_speeds
from vdet.workers import Advance

_MOVED = 0.2
"""Minimum distance that a vehicle moves to be compared, in heights of its box."""
_SAME = 0.5
"""Maximum mean distance of vehicles in an overlap, in heights. It is 0.8 to 1 for another camera,
and 0.2 to 0.4 where one of two runs finds the vehicles a second later.
"""
_SAMPLES = 8
"""Maximum number of moments that are compared."""
_SEAM_STEP = 0.1
"""Minimum seconds between two frames that are not the same moment."""

_log = logging.getLogger("vdet")

_MIN_GAP = 0.1
"""Minimum seconds of a gap by two clocks with fractions of a second, and of an overlap."""
_STEP = 0.04
"""Assumed duration of the only frame of a video, seconds."""
_LONGEST_STEP = 1.0
"""Maximum duration of the last frame of a video, seconds."""
_GOPRO = re.compile(r"(?<![a-z0-9])g(?:opr|[a-z](\d\d))(\d{4})(?!\d)", re.IGNORECASE)
"""Chapter and number of a recording: GX020017 continues GX010017, and GP010017 GOPR0017."""


@dataclass(frozen=True, slots=True)
class Overlap:
    """How long two videos overlap, seconds, and whether they show moving vehicles then."""

    seconds: float
    has_vehicles: bool


class MovingVehicles:
    """The vehicles that move in a part of a video.

    Parameters
    ----------
    frames
        The part; frames without a vehicle may be omitted.
    zero
        What is subtracted from their times, seconds.
    scale
        What pixels are multiplied by.

    Attributes
    ----------
    times
        Seconds of each frame since `zero`, ascending, `(n,)`.
    shown
        Those of frames with a vehicle that moves.
    """

    def __init__(self, frames: Iterable[FrameTracks], zero: float, scale: float = 1.0) -> None:
        rows, times = defaultdict[int, list[tuple[float, ...]]](list), []
        for number, frame in enumerate(frames):
            times.append(frame.time - zero)
            for track in frame.tracks:
                rows[track.id].append((number, *track.foot, track.box.height))
        vehicles = [np.array(row) for row in rows.values()]
        moving = [v for v in vehicles if np.ptp(v[:, 1:3], axis=0).max() >= _MOVED * v[:, 3].max()]
        every = np.concatenate([np.empty((0, 4)), *moving])
        every = every[every[:, 0].argsort(kind="stable")]
        self.times = np.array(times)
        self.shown = self.times[np.unique(every[:, 0]).astype(int)]
        starts = np.searchsorted(every[:, 0], np.arange(1, len(times)))
        self._by_frame = np.split(scale * every[:, 1:], starts)

    def at(self, time: float) -> Float64Array:
        """Return x and y of the feet and the heights in the frame at a time, pixels, `(k, 3)`."""
        nearest = int(np.abs(self.times - time).argmin())
        is_near = abs(self.times[nearest] - time) <= _SEAM_STEP
        return self._by_frame[nearest] if is_near else np.empty((0, 3))


def find_overlap(before: MovingVehicles, after: MovingVehicles, by_clocks: float) -> Overlap | None:
    """Return how long two videos overlap; None if their vehicles differ whenever that may be.

    Parameters
    ----------
    before, after
        The end of a video, its times counted to its end, and the start of the next one.
    by_clocks
        Seconds of the overlap by the clocks; the true one is up to `SEAM` shorter or longer.
    """
    lengths = [*-before.times[np.abs(-before.times - by_clocks) <= SEAM], by_clocks]
    distances = {float(length): _distance(before, after, length) for length in lengths}
    same = {length: mean for length, mean in distances.items() if mean is not None}
    empty = [length for length in distances if length not in same]

    def off(length: float) -> float:
        return abs(length - by_clocks)

    best = min(same, key=lambda length: (round(same[length], 3), off(length)), default=0.0)
    is_same = same.get(best, 1.0) <= _SAME
    if is_same and (by_clocks > SEAM or _fits_better(before, after, same[best])):
        return Overlap(best, has_vehicles=True)
    return Overlap(min(empty, key=off), has_vehicles=False) if empty else None


def _distance(before: MovingVehicles, after: MovingVehicles, length: float) -> float | None:
    """Return the mean distance of vehicles in an overlap of a length; None without vehicles."""
    every = np.concatenate([before.shown + length, after.shown])
    every = np.unique(every[(every >= 0) & (every <= min(length, after.times[-1]))].round(3))
    if not len(every):
        return None
    chosen = every[np.unique(np.linspace(0, len(every) - 1, _SAMPLES).astype(int))]
    pairs = [_distances(before.at(time - length), after.at(time)) for time in chosen.tolist()]
    return float(np.concatenate(pairs).mean())


def _distances(first: Float64Array, second: Float64Array) -> Float64Array:
    """Return the distance of each vehicle to the nearest in the other frame, at most 1 height."""
    if not (len(first) and len(second)):
        return np.ones(len(first) + len(second))
    apart = np.hypot(*(first[:, np.newaxis, :2] - second[:, :2]).transpose(2, 0, 1))
    nearest = np.concatenate([apart.min(axis=1) / first[:, 2], apart.min(axis=0) / second[:, 2]])
    return np.asarray(nearest.clip(max=1))


def _fits_better(before: MovingVehicles, after: MovingVehicles, distance: float) -> bool:
    """Return whether vehicles are nearer in an overlap than if the next video began at the end."""
    at_end = _distances(before.at(float(before.times[-1])), after.at(float(after.times[0])))
    return not len(at_end) or float(at_end.mean()) > distance + _MOVED


def natural_order(path: Path) -> list[tuple[str, int]]:
    """Return a key that sorts clip2 before clip10, and chapters of a GoPro by their recording."""
    name = _GOPRO.sub(lambda match: f"g{match[2]} {match[1] or 0}", str(path).casefold())
    return [(text, int(digits or -1)) for text, digits in re.findall(r"(\D*)(\d*)", name)]


def count_files(
    paths: Sequence[Path],
    settings: Settings,
    size: tuple[int, int] | None = None,
    rate: float | None = None,
    *,
    with_all_classes: bool = False,
    advance: Advance = lambda _: None,
) -> dict[str, Counts]:
    """Count the vehicles of files of tracks of one camera at the lines and zones of the settings.

    Files are put in the order of their clocks, or without any in that of the numbers in their
    names. Where clocks, or `input.begin`, say that one follows another, a vehicle in both is one
    vehicle. Frames that the next file shows again, by its vehicles, count once, with a warning
    (logger "vdet"). Files without a clock are counted on their own, after the others. Regions hold
    as in a run; people count only in tracks of vdet, or if the settings choose them.

    Parameters
    ----------
    size
        Width and height of the frames, pixels; None: from the file, else from `camera.size`.
    rate
        Frames per second, for a file without times.
    with_all_classes
        As for `VehicleCounter`.
    advance
        Called after each file with 1.

    Returns
    -------
    The counts of each file, in their order. No two vehicles have the same number, in all files.

    Raises
    ------
    TruthError
        A file cannot be used, its times are missing or wrong, or it overlaps another and shows
        other vehicles then.
    ConfigError
        The lines do not fit the frames, the size of the frames is unknown, a name does not match
        the pattern of the clock, or no file needs the `rate`.
    """
    rate_is_used = rate is None
    recording = _Recording(settings, with_all_classes=with_all_classes)
    distinct = list(dict.fromkeys(paths))
    order = recording.in_order(distinct) if len(distinct) > 1 else [(distinct[0], None)]
    for path, clock_of_head in order:
        saved = read_tracks(path, size=size)
        if not saved.has_times:
            if rate is None:
                raise TruthError(f"{path}: has no times", field="rate")
            saved, rate_is_used = saved.at_rate(rate), True
        clock = clock_of_head
        if len(order) == 1:
            clock = find_clock(path, settings, saved=saved)
        if not (saved.video or settings.classes):
            saved = _without_people(path, saved, settings)
        recording.add(path, saved, clock, _frame_size(settings, size or saved.size))
        advance(1)
    if not rate_is_used:
        raise ConfigError("rate: changes nothing, because the tracks have times; remove it")
    return recording.counts()


def _without_people(path: Path, saved: SavedTracks, settings: Settings) -> SavedTracks:
    """Return the tracks of another tool without people, with a warning, as a run has none."""
    names = {track.class_name for track in saved.tracks}
    people = {name for name in names if name and standard_class(name) == "person"}
    if not people or "person" in settings.detector.vehicle_classes:
        return saved
    _log.warning("%s: people are not counted; to count them, use --class person", path)
    frames = {
        index: [track for track in tracks if track.class_name not in people]
        for index, tracks in saved.frames.items()
    }
    return replace(saved, frames={index: kept for index, kept in frames.items() if kept})


def count_frames(
    frames: Iterable[FrameTracks],
    settings: Settings,
    size: tuple[int, int] | None = None,
    *,
    with_all_classes: bool = False,
) -> Counts:
    """Count the vehicles in the tracks of each frame; arguments and errors as for `count_files`."""
    frame_size = _frame_size(settings, size)
    recording = _Recording(settings, with_all_classes=with_all_classes)
    recording.count(_CountedVideo("", frame_size), frames)
    return recording.counts()[""]


def _frame_size(settings: Settings, size: tuple[int, int] | None) -> tuple[int, int]:
    if not settings.traffic:
        raise ConfigError("no lines or zones to count at; add them to the settings")
    if size := size or settings.camera.size:
        return size
    raise ConfigError("the lines are fractions of the frame", field="size")


@dataclass(slots=True)
class _CountedVideo:
    """A video of a group; times are seconds of its own.

    Attributes
    ----------
    size
        Width and height of its frames, pixels.
    first, start
        Times of its first frame, and from which on frames count.
    is_complete
        Whether its last frame is known, also without a vehicle.
    findings, source
        As in `Counts`.
    shift, frame_shift, id_shift
        What converts its times, and the numbers of its frames and tracks, to those of the group.
    spans
        As in `Counts`.
    last, end, next_shift
        Time of its last frame, the end of that, and the `frame_shift` of the video after it.
    """

    name: str
    size: tuple[int, int]
    clock: Clock | None = None
    first: float = 0.0
    is_complete: bool = True
    source: SourceVideo | None = None
    findings: tuple[Finding, ...] = ()
    meter: SpeedMeter | None = None
    start: float = -math.inf
    shift: float = 0.0
    frame_shift: int = 0
    id_shift: int = 0
    spans: tuple[Span, ...] = ()
    last: float = 0.0
    end: float = 0.0
    next_shift: int = 0

    def counts(self, group: Counts) -> Counts:
        """Return the counts of this video from those of its group, at its own times and frames."""
        events = (
            replace(
                event,
                time=round(event.time - self.shift, 3),
                frame=event.frame - self.frame_shift,
                id=event.id - self.id_shift,
            )
            for event in group.events
            if self.frame_shift <= event.frame < self.next_shift
        )
        spans = self.spans or ((self.first, self.first),)
        of_video = replace(
            group,
            events=tuple(events),
            spans=spans,
            clock=self.clock,
            findings=with_counted(self.findings, group.findings),
            source=self.source,
            left_out=self.start if self.start > self.first else None,
        )
        return with_speeds(of_video, self.meter)


class _Recording:
    """The videos of one camera; those that follow one another, of one size, share a counter."""

    def __init__(self, settings: Settings, *, with_all_classes: bool) -> None:
        self._settings, self._with_all_classes = settings, with_all_classes
        self._counts: dict[str, Counts] = {}
        self._counter: VehicleCounter | None = None
        self._group: list[_CountedVideo] = []  # the videos of this counter
        # What ends last, with a clock.
        self._latest: tuple[_CountedVideo, SavedTracks] | None = None
        self._is_chain = False  # whether each video begins at the end of the one before

    def in_order(self, paths: Sequence[Path]) -> list[tuple[Path, Clock | None]]:
        """Return files in their order, with the clocks that their names and first frames give.

        With `input.begin`, the clock of the first file is set to it, and those of the others with
        it; if none has a clock without doubt, that of the first one only.
        """
        begin = self._settings.input.begin
        own_input = self._settings.input.model_copy(update={"begin": None})
        own = self._settings.model_copy(update={"input": own_input})
        every = sorted(paths, key=natural_order)
        heads = {path: read_head(path) for path in every}
        clocks = {path: find_clock(path, own, saved=heads[path]) for path in every}
        known = {
            path: clock
            for path, clock in clocks.items()
            if clock and not (begin and clock.is_doubtful)
        }
        order = sorted(known, key=lambda path: known[path].at(heads[path].first_time))
        order += [path for path in every if path not in known]
        if begin:
            given = find_clock(order[0], self._settings)
            assert given
            self._is_chain = not known
            later = given.zero - known.get(order[0], given).zero
            known = {path: replace(given, zero=c.zero + later) for path, c in known.items()}
            known[order[0]] = given
        return [(path, known.get(path)) for path in order]

    def add(
        self, path: Path, saved: SavedTracks, clock: Clock | None, size: tuple[int, int]
    ) -> None:
        """Count in the next video, whose frames have this size."""
        before = self._latest
        video = _CountedVideo(
            str(path), size, clock, saved.first_time, saved.covered is not None, saved.video
        )
        video.findings = at_places(saved.findings)
        if self._is_chain and before:
            video.clock = _clock_after(before[0], video)
        gap = 0.0
        if before and video.clock:
            gap = _gap(*before, video, saved)
            video.shift = before[0].shift + before[0].end + gap - video.first
            if gap < 0:
                video.start = video.first - gap
        follows = before and video.clock and self._group[-1].size == size
        self.count(video, saved, follows=bool(follows))
        if video.clock and (video.spans or not before):
            self._latest = video, saved

    def count(
        self, video: _CountedVideo, frames: Iterable[FrameTracks], *, follows: bool = False
    ) -> None:
        """Count in a video, with the counter of the one before if it follows that."""
        settings, size = self._settings, video.size
        if ground := ground_of(settings.camera, *size):
            video.meter = SpeedMeter(ground, *size)
        regions = Regions(settings.regions, *size) if settings.regions else None
        if self._counter and follows:
            video.frame_shift = self._group[-1].next_shift
            video.id_shift = self._counter.start_video()
        else:
            started = 0
            if self._counter:
                started = self._counter.linker.started
                self.counts()
            all_classes = self._with_all_classes
            self._counter = VehicleCounter(settings, *size, started, with_all_classes=all_classes)
            self._group = []
        self._group.append(video)
        latest: FrameTracks | None = None
        first_span, step = len(self._counter.spans), _STEP
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
                seen = frame.inside(regions) if regions else frame
                index, time = frame.index + video.frame_shift, frame.time + video.shift
                self._counter.update(replace(seen, index=index, time=time))
                if video.meter:
                    video.meter.add(seen)
        video.last = round(latest.time, 6) if latest else video.first
        video.end = max(video.start, video.last + min(step, _LONGEST_STEP))
        video.next_shift = video.frame_shift + (latest.index + 1 if latest else 0)
        video.spans = tuple(
            (round(first - video.shift, 6), round(last - video.shift, 6))
            for first, last in self._counter.spans[first_span:]
        )

    def counts(self) -> dict[str, Counts]:
        """Return the counts of each video so far, in order, with times in that video."""
        assert self._counter
        group = self._counter.counts()
        for video in self._group:
            own = video.counts(group)
            kept = without(own.findings, self._settings.conditions.ignore)
            self._counts[video.name] = replace(own, findings=kept)
            group = replace(group, findings=())  # the first video has those of the group
        return self._counts


def _clock_after(before: _CountedVideo, video: _CountedVideo) -> Clock:
    """Return the clock of a video that begins where the one before ends."""
    if not before.is_complete:
        fault = "the file before does not say how long its video is; use .jsonl tracks"
        raise TruthError(f"{video.name}: has no clock, and {fault}")
    assert before.clock
    zero = before.clock.at(before.end) - timedelta(seconds=video.first)
    return replace(before.clock, zero=zero.astimezone(UTC))


def _gap(
    before: _CountedVideo, saved: SavedTracks, video: _CountedVideo, frames: SavedTracks
) -> float:
    """Return the seconds from the end of a video to the next one; negative if they overlap.

    Clocks with whole seconds do not measure small gaps; vehicles show overlaps. Raises `TruthError`
    if the videos overlap and show other vehicles.
    """
    assert before.clock
    assert video.clock
    gap = (video.clock.at(video.first) - before.clock.at(before.end)).total_seconds()
    is_exact = not (before.clock.has_whole_seconds or video.clock.has_whole_seconds)
    overlap: Overlap | None = Overlap(0.0, has_vehicles=False)
    if gap < (-_MIN_GAP if is_exact else SEAM):
        reach = max(0.0, -gap) + SEAM
        end = list(_between(saved, before.end - reach, math.inf))
        start = list(_between(frames, video.first, video.first + reach))
        if end and start:
            scale = before.size[0] / video.size[0]
            overlap = find_overlap(
                MovingVehicles(end, before.end), MovingVehicles(start, video.first, scale), -gap
            )
    if overlap and overlap.has_vehicles and overlap.seconds >= _MIN_GAP:
        _log.warning(
            "%s: begins %.1f s before the end of %s; these frames are not counted again; if its "
            "clock is wrong, count it on its own",
            video.name,
            overlap.seconds,
            before.name,
        )
        return -overlap.seconds
    if gap < -SEAM:
        if overlap is None:
            raise TruthError(
                f"{video.name}: begins {-gap:.1f} s before the end of {before.name} by their "
                "clocks, but shows other vehicles then; count two cameras in two calls, or "
                "correct a wrong clock"
            )
        return -overlap.seconds or gap
    is_gap = gap > _MIN_GAP if is_exact else gap + before.end - before.last > SEAM
    return gap if is_gap else 0.0


def _between(saved: SavedTracks, first: float, last: float) -> SavedTracks:
    """Return the frames from one time to another, seconds."""
    times = saved.times
    frames = {at: tracks for at, tracks in saved.frames.items() if first <= times[at] <= last}
    covered = [index for index in saved.covered or () if first <= times[index] <= last]
    return replace(saved, frames=frames, covered=covered)
