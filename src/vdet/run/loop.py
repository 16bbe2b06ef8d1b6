"""One video: from its frames to results.

`build` makes the `Pipeline` of a video, and `Pipeline.follow` passes its frames through:

1. `search_frames`, in threads: everything that needs no earlier frame;
2. `observe`, in the order of the frames: the detections go to the tracker;
3. a delay of `look_ahead` seconds of video, so that the tracker knows later detections;
4. `complete`: the tracks at the time of the frame, and then every step.

Where nothing moves, fewer frames are searched, if the detector is stateless. The search of a
segment has two phases: first its last frame, the key frame, then the frames between two key frames,
if these differ.
"""

import itertools
import math
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import chain
from pathlib import Path
from statistics import fmean
from typing import Any

from vdet.boxes import NO_BOXES, Boxes, Image, iou_matrix
from vdet.conditions.cuts import with_cuts
from vdet.config.schema import Settings
from vdet.detect.detectors import DetectorModel, VideoDetector
from vdet.errors import ConfigError, ImageError, VdetError
from vdet.media import Frame, VideoInfo
from vdet.run.steps import (
    Facts,
    FindingStep,
    FrameResult,
    ParallelStep,
    Step,
    StepContext,
    make_steps,
)
from vdet.track.track import ShotTracker, TimedTracker, VideoTracker, make_tracker, timed
from vdet.workers import SearchThreads

_INTERVALS = 25
"""Number of the latest frame intervals whose trimmed mean is the usual interval."""

_TOLERANCE = 0.1
"""Tolerance of the distance between searches, 1 / `searches`, in frames.

With 12 searches per second, every second frame is searched at 23.976 frames/s, as at 24. In the
same way, `MAX_KEY_INTERVAL` may be exceeded by this fraction of the usual distance between
searches.
"""

MAX_KEY_INTERVAL = 0.25
"""Maximum time between the searches of two key frames, seconds.

In the project video, with none, 630 frames are searched instead of 570, and a run takes 13 % more
processor time.
"""
_MAX_SEGMENT = 16
"""Maximum number of frames of a segment: they are in memory together."""
_MIN_SCORE = 0.15
"""Minimum score of the boxes by which two key frames are compared."""
_SAME_IOU = 0.9
"""Minimum intersection over union of two boxes in the same place."""
FIRST_FRAMES = 2
"""Number of frames passed to `DetectorModel.for_video`."""
_MAX_WAITING = 60
"""Maximum number of frames in memory that wait for later ones."""
_DECIDED = Fraction(2)
"""Seconds of later frames that decide whether a track is of the selected classes."""


@dataclass(frozen=True, slots=True)
class SearchRate:
    """How often the frames of a video are searched; the first frame always is.

    Frames are chosen by their times, because the declared frame rate of a file may be wrong.

    Attributes
    ----------
    searches
        Minimum number of searches per second; None for every frame.
    stride
        Search every `stride`-th frame; overrides `searches`. None to use `searches`.
    """

    searches: float | None = None
    stride: int | None = None

    def choose(self, frames: Iterable[Frame]) -> Iterator[tuple[Frame, bool]]:
        """Yield each frame, and whether it is searched.

        Raises
        ------
        ValueError
            A time is not a finite number, or is not later than that of the previous frame.
        """
        intervals: deque[float] = deque(maxlen=_INTERVALS)
        previous_time, since_search = None, 0.0  # seconds
        for position, frame in enumerate(frames):
            if previous_time is not None:
                intervals.append(float(frame.time - previous_time))
                if not 0 < intervals[-1] < math.inf:
                    raise ValueError(
                        f"frame {frame.index} at {float(frame.time):g} s is not after the last one"
                    )
                since_search += intervals[-1]
            previous_time = frame.time
            is_searched = self._is_due(position, since_search, intervals)
            since_search = 0.0 if is_searched else since_search
            yield frame, is_searched

    def _is_due(self, position: int, since_search: float, intervals: Sequence[float]) -> bool:
        if self.stride is not None:
            return position % self.stride == 0
        if self.searches is None or not position:
            return True
        ordered, quarter = sorted(intervals), len(intervals) // 4
        usual = fmean(ordered[quarter : len(ordered) - quarter])  # a few odd ones do not change it
        longest = 1 / self.searches
        distance = max(1, int(longest / usual + _TOLERANCE))  # frames
        return since_search >= min((distance - 0.5) * usual, longest)


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """Consecutive frames.

    Attributes
    ----------
    frames
        Each with whether the search rate chooses it.
    has_key
        Whether the last frame is a key frame. If it shows the same as the key frame of the segment
        before, the frames between the two are not searched.
    """

    frames: Sequence[tuple[Frame, bool]]
    has_key: bool = False


def segments(chosen: Iterable[tuple[Frame, bool]], key_interval: float) -> Iterator[Segment]:
    """Yield frames in segments that end with a chosen frame.

    A segment is as long as possible with at most `key_interval` seconds between key frames. With 0,
    it has one chosen frame. Very long segments, and the last one, may end with any frame.
    """
    frames: list[tuple[Frame, bool]] = []
    last_search = end = -math.inf  # times of the last search, and of the end of the last segment
    for frame, is_chosen in chosen:
        frames.append((frame, is_chosen))
        is_full = len(frames) >= _MAX_SEGMENT
        if is_chosen:
            time = float(frame.time)
            next_search = time + (1 - _TOLERANCE) * (time - last_search)
            is_full |= next_search - end > key_interval
            last_search = time
        if is_full:
            yield Segment(frames, has_key=is_chosen)
            frames, end = [], last_search
    if frames:
        yield Segment(frames)


@dataclass(frozen=True, slots=True, eq=False)
class SearchedFrame:
    """A frame after its search, or a frame that is not searched.

    `detections` are known if the detector is stateless; otherwise it makes them from `candidates`,
    in the order of the frames.
    """

    frame: Frame
    is_searched: bool = False
    candidates: Any = None
    detections: Boxes | None = None


def shows_same(before: Boxes, after: Boxes) -> bool:
    """Return whether two frames show the same vehicles in the same places."""
    a, b = (boxes.sides[boxes.scores >= _MIN_SCORE] for boxes in (before, after))
    in_place = iou_matrix(a, b) >= _SAME_IOU
    return len(a) == len(b) and bool(in_place.any(axis=0).all())


def search_frames(
    frames: Iterable[Frame],
    detector: VideoDetector,
    rate: SearchRate,
    *,
    steps: Sequence[Step] = (),
    threads: int = 1,
) -> Generator[SearchedFrame]:
    """Search the frames of one video in threads; yield them in their order.

    Parameters
    ----------
    steps
        Those of the video: the parallel ones prepare all frames.
    threads
        Number of frames searched at once. The results do not depend on it. At most this number of
        segments, and one more, are in memory.

    Raises
    ------
    ValueError
        The times of the frames do not increase.
    """
    parallel = [step for step in steps if isinstance(step, ParallelStep)]
    is_stateless = getattr(detector, "is_stateless", False)
    may_skip = is_stateless and rate.searches and rate.stride is None
    parts = segments(rate.choose(frames), MAX_KEY_INTERVAL if may_skip else 0)
    finished: Iterable[SearchedFrame] = ()
    before: Boxes | None = None  # what the last key frame shows

    def search(frame: Frame, is_due: bool) -> SearchedFrame:
        if not is_due:
            return SearchedFrame(frame)
        candidates = detector.search(frame.picture, frame.index)
        if is_stateless:
            return SearchedFrame(frame, True, detections=detector.detect(candidates))
        return SearchedFrame(frame, True, candidates)

    def search_last(segment: Segment) -> SearchedFrame:
        """Do the first phase: prepare all frames, and search the last one if it is chosen."""
        for step in parallel:
            for frame, _ in segment.frames:
                step.prepare(frame)
        return search(*segment.frames[-1])

    with SearchThreads(threads) as pool:
        ahead = max(1, threads - 1)  # and the one whose second phase has begun
        for segment, last in pool.map_ordered(search_last, parts, ahead):
            key = last.detections if segment.has_key else None
            is_still = before is not None and key is not None and shows_same(before, key)
            before = key
            between = [
                pool.submit(search, frame, is_chosen and not is_still)
                for frame, is_chosen in segment.frames[:-1]
            ]
            # Threads stay busy while the caller uses the frames of the segment before.
            yield from finished
            finished = chain((future.result() for future in between), [last])
        yield from finished


@dataclass(frozen=True, slots=True)
class Pipeline:
    """Detector, tracker and steps for the frames of one video.

    Attributes
    ----------
    steps
        Each receives every result, in the order of the frames.
    rate
        Which frames are searched.
    look_ahead
        Seconds of video to search after a frame before its tracks are shown.
    """

    detector: VideoDetector
    tracker: TimedTracker
    steps: Sequence[Step] = ()
    rate: SearchRate = field(default_factory=SearchRate)
    look_ahead: Fraction = Fraction(0)

    def follow(
        self, frames: Iterable[Frame], source: Path = Path(), *, threads: int = 1
    ) -> Generator[FrameResult]:
        """Find and follow the vehicles; yield the result of each frame.

        Parameters
        ----------
        source
            The video, for `FrameResult.source`.
        threads
            Number of frames searched at once. The results do not depend on it.

        Raises
        ------
        ValueError
            The times of the frames do not increase.
        """
        search = search_frames(frames, self.detector, self.rate, steps=self.steps, threads=threads)
        with closing(search) as searched_frames:
            shots = with_cuts((searched.frame, searched) for searched in searched_frames)
            observed = (self.observe(searched, source, is_cut=cut) for searched, cut in shots)
            for result in _delayed(observed, self.look_ahead):
                yield self.complete(result)

    def observe(self, searched: SearchedFrame, source: Path, *, is_cut: bool) -> FrameResult:
        """Pass the next frame to the tracker; return its result, still without tracks.

        `is_cut` says whether a jump cut comes before it.
        """
        frame, detections = searched.frame, searched.detections
        if is_cut and isinstance(self.tracker, ShotTracker):
            self.tracker.begin_shot(float(frame.time))
        if not searched.is_searched:
            return FrameResult(source, frame, NO_BOXES, (), searched=False, is_cut=is_cut)
        if detections is None:
            detections = self.detector.detect(searched.candidates)
        self.tracker.observe(detections, float(frame.time), frame.picture)
        return FrameResult(source, frame, detections, (), is_cut=is_cut)

    def complete(self, result: FrameResult) -> FrameResult:
        """Return the next result with its tracks, after all steps."""
        complete = replace(result, tracks=tuple(self.tracker.at(float(result.frame.time))))
        for step in self.steps:
            complete = step.apply(complete)
        return complete

    def facts(self) -> Facts:
        """Return the results of steps about the whole video, after its last frame."""
        finding = (step for step in self.steps if isinstance(step, FindingStep))
        return {name: fact for step in finding for name, fact in step.finish().items()}


def _delayed(results: Iterable[FrameResult], seconds: Fraction) -> Iterator[FrameResult]:
    """Yield each result when the results of the next `seconds` of video are known."""
    waiting = deque[FrameResult]()
    for result in results:
        waiting.append(result)
        until = result.frame.time - seconds
        while waiting and (waiting[0].frame.time <= until or len(waiting) > _MAX_WAITING):
            yield waiting.popleft()
    while waiting:
        yield waiting.popleft()


def with_later_classes(results: Iterable[FrameResult]) -> Iterator[FrameResult]:
    """Yield results in which tracks have the class that they have `_DECIDED` later."""
    classes: dict[int, str | None] = {}

    def read() -> Iterator[FrameResult]:
        for result in results:
            classes.update((track.id, track.class_name) for track in result.tracks)
            yield result

    for result in _delayed(read(), _DECIDED):
        tracks = (replace(track, class_name=classes[track.id]) for track in result.tracks)
        yield replace(result, tracks=tuple(tracks))


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of a run that find and track the vehicles.

    Attributes
    ----------
    model
        Makes the detector of each video.
    tracker
        A tracker for one video; None: the settings choose it.
    steps
        Steps in addition to those of the settings.
    """

    model: DetectorModel
    tracker: VideoTracker | None = None
    steps: Sequence[Step] = ()


def build(parts: Parts, settings: Settings, video: VideoInfo, images: Sequence[Image]) -> Pipeline:
    """Make the pipeline of a video; `images` are its first ones, from `peek`.

    Raises
    ------
    FrameSizeError
        Frames of this size are too small to search.
    ConfigError, ImageError
        The points or the lens in the settings do not fit the frames.
    """
    width, height = video.width, video.height
    make = partial(make_tracker, settings, width, height)
    detector = parts.model.for_video(width, height, images)
    return Pipeline(
        detector,
        timed(parts.tracker) if parts.tracker else ShotTracker(make),
        steps=[*make_steps(StepContext(settings, width, height, video)), *parts.steps],
        rate=SearchRate(settings.detector.searches_per_second, settings.detector.stride),
        look_ahead=Fraction(settings.tracker.look_ahead),
    )


def peek(frames: Iterable[Frame]) -> tuple[Sequence[Image], Iterable[Frame]]:
    """Return the images for `DetectorModel.for_video`, and an iterable of all frames."""
    remaining = iter(frames)
    first = list(itertools.islice(remaining, FIRST_FRAMES))
    images = [frame.image for frame in first]
    # The iterator has a list of its own, which it releases; the images can be released before.
    return images, itertools.chain(iter([*first]), remaining)


@contextmanager
def named_errors(source: Path, kind: type[VdetError]) -> Iterator[None]:
    """Raise errors of settings and images as `kind`, with the name of the source."""
    try:
        yield
    except (ConfigError, ImageError) as error:
        raise kind(f"{source}: {error}") from error
