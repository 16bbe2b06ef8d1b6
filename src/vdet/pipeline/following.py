"""Frames of one size → what is found in each: search, heat, tracker, and lane."""

import itertools
import logging
from collections.abc import Generator, Iterable

from vdet.config.schema import Settings
from vdet.detect.svm.detector import Detector, horizon_of, nothing_detected
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.windows import Windows
from vdet.lanes.road import FrameView, RoadFinder
from vdet.media import Frame
from vdet.pipeline.result import FrameResult
from vdet.pipeline.threads import each_with
from vdet.track.factory import tracker_of

HORIZON_FRAMES = 5
"""From the first one on, in which the horizon is looked for."""

log = logging.getLogger("vdet")


def follow(
    frames: Iterable[Frame],
    model: LinearModel,
    settings: Settings,
    width: int,
    height: int,
    *,
    threads: int = 1,
    watch: RoadFinder | None = None,
) -> Generator[FrameResult]:
    """Find and follow the cars through frames of one size, in order; and the lane, with `watch`.

    The search of several frames may run in `threads` at once; what follows it, frame by frame,
    gives the same result whatever their number.

    Raises
    ------
    ImageError
        No search window fits into such a frame.
    """
    frames, horizon = seek_horizon(frames, settings)
    detector = Detector(model, settings, width, height, horizon=horizon)
    track = tracker_of(settings, width, height)

    def search(frame: Frame) -> tuple[Windows, FrameView | None]:
        windows = detector.search(frame.image, frame.index)
        return windows, watch.observe(frame.image) if watch else None

    with each_with(search, frames, threads) as searched:
        for frame, (windows, look) in searched:
            detection = detector.accumulate(windows)
            tracks = track(frame.image, detection.regions)
            road = watch.update(look) if watch and look else None
            yield FrameResult(frame, detection, tuple(tracks), road)


def seek_horizon(frames: Iterable[Frame], settings: Settings) -> tuple[Iterable[Frame], float]:
    """Return the same frames, and the horizon's row as a share of their height."""
    rest = iter(frames)
    first = list(itertools.islice(rest, HORIZON_FRAMES))
    horizon = horizon_of(settings, [frame.image for frame in first])
    log.info("the horizon lies at %.2f of the height", horizon)
    return itertools.chain(first, rest), horizon


def pass_on(
    frames: Iterable[Frame], settings: Settings, width: int, height: int, watch: RoadFinder | None
) -> Generator[FrameResult]:
    """Give frames without cars; the lane is found all the same."""
    nothing = nothing_detected(settings, width, height)
    for frame in frames:
        road = watch.update(watch.observe(frame.image)) if watch else None
        yield FrameResult(frame, nothing, (), road)
