"""Frames that the detector searches, and those that only the tracker follows: `detector.stride`."""

from dataclasses import dataclass
from typing import Any

from vdet.detect.detections import NO_DETECTIONS, Detections
from vdet.detect.protocol import VideoDetector
from vdet.media import Frame
from vdet.track.protocol import CarryingTracker
from vdet.track.track import Track


@dataclass(frozen=True, slots=True)
class Search:
    """What the search of a frame gave; `candidates` are those of the detector."""

    candidates: Any


def search_frame(
    detector: VideoDetector, frame: Frame, position: int, stride: int
) -> Search | None:
    """Search a frame if it is its turn; None where it is not.

    Parameters
    ----------
    position
        How many frames were read before it. The first frame is searched, wherever it lies.
    stride
        Every so many frames one is searched.
    """
    if position % stride:
        return None
    return Search(detector.search(frame.picture, frame.index))


def follow_frame(
    detector: VideoDetector, tracker: CarryingTracker, found: Search | None, frame: Frame
) -> tuple[Detections, tuple[Track, ...]]:
    """Follow the vehicles into a frame; return its detections, if it was searched, and its tracks.

    `found` is what `search_frame` returned for it.
    """
    time = float(frame.time)
    if found is None:
        return NO_DETECTIONS, tuple(tracker.carry(time, frame.picture))
    detections = detector.detect(found.candidates)
    return detections, tuple(tracker.update(detections, time, frame.picture))
