"""The loop: frames → detector → tracker → steps → results.

`build` makes the `Pipeline` of a video, and `Pipeline.follow` passes its frames through:

1. `search`, in threads: everything that needs no earlier frame, or only the last searched one;
2. `observe`, in the order of the frames: the detections go to the tracker;
3. a delay of `look_ahead` seconds of video, so that the tracker knows later detections;
4. `complete`: the tracks at the time of the frame, and then every step.
"""

import itertools
import math
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from statistics import fmean
from typing import Any

from vdet.boxes import NO_BOXES, Boxes, Image, iou_matrix
from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel, VideoDetector
from vdet.errors import ConfigError, ImageError, VdetError
from vdet.media import Frame, VideoInfo
from vdet.run.result import Facts, FrameResult
from vdet.run.steps import FindingStep, ParallelStep, Step, StepContext, make_steps
from vdet.run.threads import map_ordered
from vdet.track.factory import make_tracker, timed
from vdet.track.track import TimedTracker, Track, VideoTracker

_STEPS = 25
"""Number of the latest frame intervals whose trimmed mean is the usual interval."""

_SLACK = 0.1
"""Tolerance of the distance between searches, 1 / `searches`, in frames.

With 12 searches per second, every second frame is searched at 23.976 frames/s, as at 24. In the
same way, `LONGEST_REST` may be exceeded by this fraction of the usual distance between searches.
"""


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
        steps: deque[float] = deque(maxlen=_STEPS)
        before, since = None, 0.0  # time of the previous frame; seconds since the latest search
        for position, frame in enumerate(frames):
            if before is not None:
                steps.append(float(frame.time - before))
                if not 0 < steps[-1] < math.inf:
                    raise ValueError(
                        f"frame {frame.index} at {float(frame.time):g} s is not after the last one"
                    )
                since += steps[-1]
            before, is_searched = frame.time, self._is_due(position, since, steps)
            since = 0.0 if is_searched else since
            yield frame, is_searched

    def _is_due(self, position: int, since: float, steps: Sequence[float]) -> bool:
        if self.stride is not None:
            return position % self.stride == 0
        if self.searches is None or not position:
            return True
        ordered, quarter = sorted(steps), len(steps) // 4
        usual = fmean(ordered[quarter : len(steps) - quarter])  # a few odd steps do not change it
        longest = 1 / self.searches
        apart = max(1, int(longest / usual + _SLACK))  # frames
        return since >= min((apart - 0.5) * usual, longest)


LONGEST_REST = 0.25
"""Maximum time between two searches where nothing moves, seconds."""

_MOST_TOGETHER = 16
"""Maximum number of frames that are searched one after the other, and in memory together."""

_NOTED = 0.15
"""Minimum score of a box that must stay in its place, so that frames between are not searched."""

_IN_PLACE = 0.9
"""Minimum intersection over union of two boxes in the same place."""

_Chosen = tuple[Frame, bool]
"""A frame, and whether the rate of searches chooses it."""


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """Consecutive frames, of which the last one is searched first.

    If it shows the same as the last one of the stretch before, the others are not searched.

    Attributes
    ----------
    before
        The candidates of the last frame of the stretch before; None: search all that are chosen.
    found
        The candidates of the last frame.
    """

    frames: Sequence[_Chosen]
    before: Future[Any] | None
    found: Future[Any] = field(default_factory=Future)


def stretches(chosen: Iterable[_Chosen], longest: float) -> Iterator[Stretch]:
    """Yield frames in stretches of at most `longest` seconds, but with one search if possible.

    With 0, all that are chosen are searched.
    """
    frames: list[_Chosen] = []
    before: Future[Any] | None = None
    latest = end = -math.inf  # times of the latest search, and of the end of the stretch before
    for frame, is_chosen in chosen:
        frames.append((frame, is_chosen))
        step, latest = (float(frame.time) - latest, float(frame.time)) if is_chosen else (0, latest)
        following = latest + (1 - _SLACK) * step  # the next search
        is_full = is_chosen and following - end > longest
        if is_full or len(frames) >= _MOST_TOGETHER:
            yield (stretch := Stretch(frames, before if is_chosen else None))
            frames, before, end = [], stretch.found if is_chosen and longest else None, latest
    if frames:
        yield Stretch(frames, None)


def is_same(before: Boxes, after: Boxes) -> bool:
    """Return whether two frames show the same vehicles in the same places."""
    some, others = (boxes.sides[boxes.scores >= _NOTED] for boxes in (before, after))
    in_place = iou_matrix(some, others) >= _IN_PLACE
    return len(some) == len(others) and bool(in_place.any(axis=0).all())


FIRST_FRAMES = 2
"""Number of frames passed to `DetectorModel.for_video`."""

_MAX_WAITING = 60
"""Maximum number of frames in memory that wait for later ones."""


@dataclass(frozen=True, slots=True)
class Pipeline:
    """Detector, tracker and steps for the frames of one video, or for one single image.

    Attributes
    ----------
    steps
        Each receives every result, in the order of the frames.
    rate
        Which frames are searched.
    look_ahead
        Seconds of video to search after a frame before its tracks are shown.
    is_still
        Whether the only frame is a single image.
    """

    detector: VideoDetector
    tracker: TimedTracker
    steps: Sequence[Step] = ()
    rate: SearchRate = SearchRate()
    look_ahead: Fraction = Fraction(0)
    is_still: bool = False

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
        may_rest = self.rate.searches is not None and self.rate.stride is None
        longest = LONGEST_REST if may_rest and getattr(self.detector, "is_stateless", False) else 0
        parts = stretches(self.rate.choose(frames), longest)
        with map_ordered(self.search, parts, threads) as done:
            observed = (
                self.observe(frame, candidates, source, searched=searched)
                for _, found in done
                for frame, searched, candidates in found
            )
            for result in _delayed(observed, self.look_ahead):
                yield self.complete(result)

    def search(self, stretch: Stretch) -> list[tuple[Frame, bool, Any]]:
        """Search a stretch; return each frame, whether it was searched, and its candidates.

        Several threads may call this at once, if they begin with the stretches in their order.
        """
        *others, last = stretch.frames
        try:
            found = self._search(*last)
            stretch.found.set_result(found[-1])
        except BaseException as error:
            stretch.found.set_exception(error)  # another thread may wait for it
            raise
        before, detect = stretch.before, self.detector.detect
        rests = before is not None and is_same(detect(before.result()), detect(found[-1]))
        return [*(self._search(frame, chosen and not rests) for frame, chosen in others), found]

    def _search(self, frame: Frame, is_due: bool) -> tuple[Frame, bool, Any]:
        for step in self.steps:
            if isinstance(step, ParallelStep):
                step.prepare(frame)
        index = None if self.is_still else frame.index
        return frame, is_due, self.detector.search(frame.picture, index) if is_due else None

    def observe(
        self, frame: Frame, candidates: Any, source: Path, *, searched: bool = True
    ) -> FrameResult:
        """Pass the next frame to the tracker; return its result, still without tracks."""
        if not searched:
            return FrameResult(source, frame, NO_BOXES, (), searched=False)
        detections = self.detector.detect(candidates)
        self.tracker.observe(detections, float(frame.time), frame.picture)
        return FrameResult(source, frame, detections, ())

    def complete(self, result: FrameResult) -> FrameResult:
        """Return the next result with its tracks, after all steps."""
        complete = replace(result, tracks=tuple(self.tracker.at(float(result.frame.time))))
        for step in self.steps:
            complete = step.apply(complete)
        return complete

    def facts(self) -> Facts:
        """Return what the steps found out about the whole video, after its last frame."""
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


def build(
    parts: Parts, settings: Settings, video: VideoInfo | None, images: Sequence[Image]
) -> Pipeline:
    """Make the pipeline of a video, or of one single image.

    In a single image each detection becomes a track, with ids from 1.

    Parameters
    ----------
    video
        None for a single image.
    images
        The first frames, from `peek`, or the single image.

    Raises
    ------
    FrameSizeError
        Frames of this size are too small to search.
    ConfigError, ImageError
        The points or the lens in the settings do not fit the frames.
    """
    height, width = (video.height, video.width) if video else images[0].shape[:2]
    detector = parts.model.for_video(width, height, images)
    unknown = getattr(detector, "unknown_classes", ())
    made = make_steps(StepContext(settings, width, height, video, unknown), parts.steps)
    if video is None:
        return Pipeline(detector, timed(StillTracker()), made, is_still=True)
    own = parts.tracker
    tracker = timed(own) if own else make_tracker(settings, width, height)
    rate = SearchRate(settings.detector.searches_per_second, settings.detector.stride)
    return Pipeline(detector, tracker, made, rate, Fraction(settings.tracker.look_ahead))


def peek(frames: Iterable[Frame]) -> tuple[list[Image], Iterable[Frame]]:
    """Return the images for `DetectorModel.for_video`, and an iterable of all frames."""
    rest = iter(frames)
    first = list(itertools.islice(rest, FIRST_FRAMES))
    # A list iterator releases its list at the end; the list itself would stay for the whole run.
    return [frame.image for frame in first], itertools.chain(iter(first), rest)


@contextmanager
def named_errors(source: Path, kind: type[VdetError]) -> Iterator[None]:
    """Raise errors of settings and images as `kind`, with the name of the source."""
    try:
        yield
    except (ConfigError, ImageError) as error:
        raise kind(f"{source}: {error}") from error


class StillTracker:
    """Makes a track from each detection in a single image."""

    def update(self, detections: Boxes, *_: object) -> list[Track]:
        """Return a track for each detection, with ids from 1."""
        return [
            Track(number, found.box, found.score, "detected", found.class_name)
            for number, found in enumerate(detections, start=1)
        ]
