"""The loop: frames → detector → tracker → steps → results.

`build` makes the `Pipeline` of a video, and `Pipeline.follow` passes its frames through:

1. `search_frames`, in threads: everything that needs no earlier frame;
2. `observe`, in the order of the frames: the detections go to the tracker;
3. a delay of `look_ahead` seconds of video, so that the tracker knows later detections;
4. `complete`: the tracks at the time of the frame, and then every step.
"""

import itertools
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from pathlib import Path

from vdet.boxes import NO_BOXES, Image
from vdet.conditions.cuts import with_cuts
from vdet.config.schema import Settings
from vdet.detect.detectors import DetectorModel, VideoDetector
from vdet.errors import ConfigError, ImageError, VdetError
from vdet.media import Frame, VideoInfo
from vdet.run.result import Facts, FrameResult
from vdet.run.search import SearchedFrame, SearchRate, search_frames
from vdet.run.steps import FindingStep, Step, StepContext, make_steps
from vdet.track.factory import ShotTracker, make_tracker, timed
from vdet.track.track import TimedTracker, VideoTracker

FIRST_FRAMES = 2
"""Number of frames passed to `DetectorModel.for_video`."""

_MAX_WAITING = 60
"""Maximum number of frames in memory that wait for later ones."""

_DECIDED = Fraction(2)
"""Seconds of later frames that decide whether a track is of the selected classes."""


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
