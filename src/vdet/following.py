"""Frames of one size → what is found in each: search, heat, tracker, and lane."""

from collections.abc import Generator, Iterable

from vdet.config.scaling import scale_lengths
from vdet.config.schema import Settings
from vdet.detection import Detector, nothing_detected
from vdet.frame_result import FrameResult
from vdet.lanes.road import Look, RoadWatch
from vdet.model import LinearModel
from vdet.stream import each_with
from vdet.tracking.cars import Cars
from vdet.video import Frame
from vdet.windows import Windows


def follow(
    frames: Iterable[Frame],
    model: LinearModel,
    settings: Settings,
    width: int,
    height: int,
    *,
    threads: int = 1,
    watch: RoadWatch | None = None,
) -> Generator[FrameResult]:
    """Find and follow the cars through frames of one size, in order; and the lane, with `watch`.

    The search of several frames may run in `threads` at once; what follows it, frame by frame,
    gives the same result whatever their number.

    Raises
    ------
    ImageError
        No search window fits into such a frame.
    """
    detector = Detector(model, settings, width, height)
    cars = Cars(scale_lengths(settings.tracker, height / settings.reference_height))

    def search(frame: Frame) -> tuple[Windows, Look | None]:
        return detector.search(frame.image), watch.look(frame.image) if watch else None

    with each_with(search, frames, threads) as searched:
        for frame, (windows, look) in searched:
            detection = detector.accumulate(windows)
            tracks = cars.update(frame.image, detection.regions)
            road = watch.follow(look) if watch and look else None
            yield FrameResult(frame, detection, tuple(tracks), road)


def pass_on(
    frames: Iterable[Frame], settings: Settings, width: int, height: int, watch: RoadWatch | None
) -> Generator[FrameResult]:
    """Give frames without cars; the lane is found all the same."""
    nothing = nothing_detected(settings, width, height)
    for frame in frames:
        road = watch.follow(watch.look(frame.image)) if watch else None
        yield FrameResult(frame, nothing, (), road)
