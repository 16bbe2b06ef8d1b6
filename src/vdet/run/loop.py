"""The loop: frames → detector → tracker → steps → results."""

import itertools
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from vdet.boxes import NO_BOXES, Boxes
from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel, VideoDetector, limited
from vdet.lanes.road import LaneRequest
from vdet.media import Frame, Picture, VideoInfo
from vdet.media.images import Image
from vdet.regions import lay_regions
from vdet.run.result import FrameResult
from vdet.run.steps import ParallelStep, Step, StepContext, make_steps
from vdet.run.threads import Waits, map_ordered
from vdet.track.factory import carrying, make_tracker
from vdet.track.protocol import VideoTracker

FIRST_FRAMES = 5
"""Number of frames that `DetectorModel.for_video` gets."""


def follow(
    frames: Iterable[Frame],
    detector: VideoDetector,
    tracker: VideoTracker,
    steps: Sequence[Step] = (),
    *,
    source: Path = Path(),
    stride: int = 1,
    threads: int = 1,
    waits: Waits | None = None,
) -> Generator[FrameResult]:
    """Find and follow the vehicles through the frames of a video.

    Parameters
    ----------
    steps
        Each gets every result, in the order of the frames.
    source
        The video, for the results.
    stride
        Every `stride`-th frame is searched, beginning with the first. In the others the tracker
        carries the vehicles on.
    threads
        Number of frames that are searched at once. The results do not depend on it.
    waits
        Counts how long the search is waited for.
    """
    tracker = carrying(tracker)
    prepared = [step for step in steps if isinstance(step, ParallelStep)]

    def search(numbered: tuple[int, Frame]) -> tuple[bool, Any]:
        position, frame = numbered
        for step in prepared:
            step.prepare(frame)
        if position % stride:
            return False, None
        return True, detector.search(frame.picture, frame.index)

    waiting = partial((waits or Waits()).on, "searching")
    ahead = threads * stride  # so that each thread has a frame to search
    with map_ordered(search, enumerate(frames), threads, ahead=ahead, waiting=waiting) as results:
        for (_, frame), (searched, candidates) in results:
            time, picture = float(frame.time), frame.picture
            if searched:
                detections = detector.detect(candidates)
                tracks = tracker.update(detections, time, picture)
            else:
                detections = NO_BOXES
                tracks = tracker.carry(time, picture)
            result = FrameResult(source, frame, detections, tuple(tracks), searched=searched)
            for step in steps:
                result = step.apply(result)
            yield result


@dataclass(frozen=True, slots=True)
class Pipeline:
    """What the frames of one video go through; `follow` explains it."""

    detector: VideoDetector
    tracker: VideoTracker
    steps: Sequence[Step] = ()
    stride: int = 1

    def follow(
        self,
        frames: Iterable[Frame],
        source: Path = Path(),
        *,
        threads: int = 1,
        waits: Waits | None = None,
    ) -> Generator[FrameResult]:
        """Find and follow the vehicles, as the function `follow`."""
        return follow(
            frames,
            self.detector,
            self.tracker,
            self.steps,
            source=source,
            stride=self.stride,
            threads=threads,
            waits=waits,
        )


def build(
    model: DetectorModel,
    settings: Settings,
    video: VideoInfo,
    images: Sequence[Image],
    *,
    tracker: VideoTracker | None = None,
    steps: Sequence[Step] = (),
    lanes: LaneRequest | None = None,
) -> Pipeline:
    """Build what the frames of a video go through.

    Parameters
    ----------
    images
        The first frames, from `peek`.
    tracker
        A tracker for this video; None for that of the settings.
    steps
        Steps in addition to those of the settings.
    lanes
        If it is given, the lane is found too, and the distance and the lane of each vehicle.

    Raises
    ------
    FrameSizeError
        Frames of this size are too small to be searched.
    ConfigError, ImageError
        The regions, the lines or the camera do not fit the frames.
    """
    size = video.width, video.height
    regions = lay_regions(settings.regions, *size)
    return Pipeline(
        limited(model.for_video(*size, images), regions),
        tracker or make_tracker(settings, *size),
        make_steps(StepContext(settings, *size, video, lanes), steps),
        settings.detector.stride_at(video.rate),
    )


def peek(frames: Iterable[Frame]) -> tuple[list[Image], Iterable[Frame]]:
    """Return the images that `DetectorModel.for_video` gets, and an iterable of all frames."""
    rest = iter(frames)
    first = list(itertools.islice(rest, FIRST_FRAMES))
    # A list iterator lets go of its list at the end; the list itself would stay for the whole run.
    return [frame.image for frame in first], itertools.chain(iter(first), rest)


class NullDetector:
    """A detector that finds nothing, for frames that are too small to be searched."""

    def for_video(self, *_: object) -> "NullDetector":
        """Return the detector."""
        return self

    def search(self, picture: Picture, index: int | None) -> None:
        """Do nothing."""

    def detect(self, candidates: None) -> Boxes:  # noqa: ARG002
        """Return no detections."""
        return NO_BOXES
