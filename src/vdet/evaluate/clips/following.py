"""Vehicles followed through the same frames under several settings at once.

The search takes nearly all the time, so settings that search alike share it: every frame is
searched once for them, and only what follows the search runs for each.
"""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from vdet.config.schema import Settings
from vdet.detect.factory import load_detector
from vdet.media import Frame, VideoInfo
from vdet.pipeline.loop import peek
from vdet.pipeline.result import FrameResult
from vdet.pipeline.threads import single_threaded_libraries
from vdet.track.factory import make_tracker


def follow_under_all(
    frames: Iterable[Frame], variants: Sequence[Settings], model: Path | None, video: VideoInfo
) -> Iterator[list[FrameResult]]:
    """Give for each frame a result for each of the settings, in their order.

    What is given for one of the settings does not depend on the others, and is what
    `vdet.pipeline.loop.follow_frames` gives for it.

    Parameters
    ----------
    model
        Model file of the detector; None for the shipped one.

    Raises
    ------
    ImageError
        Such frames cannot be searched.
    """
    images, frames = peek(frames)
    size = video.width, video.height
    detectors = [
        load_detector(settings.detector, model).for_video(*size, images) for settings in variants
    ]
    trackers = [make_tracker(settings, *size) for settings in variants]
    keys = [settings.detector.search_key for settings in variants]
    searchers = dict(zip(keys, detectors, strict=True))
    with single_threaded_libraries():
        for frame in frames:
            candidates = {
                key: searcher.search(frame.image, frame.index)
                for key, searcher in searchers.items()
            }
            results = []
            for key, detector, tracker in zip(keys, detectors, trackers, strict=True):
                detections = detector.detect(candidates[key])
                tracks = tuple(tracker.update(detections, float(frame.time), frame.image))
                results.append(FrameResult(video.path, frame, detections, tracks, None, detector))
            yield results
