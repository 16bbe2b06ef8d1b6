"""Frames that the detector searches, and those that only the tracker follows: `detector.stride`."""

from dataclasses import dataclass
from typing import Any

from vdet.detect.detections import Detections
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
    return Search(detector.search(frame.image, frame.index))


def follow_frame(
    tracker: CarryingTracker, detections: Detections, frame: Frame, *, searched: bool
) -> tuple[Track, ...]:
    """Follow the vehicles into a frame; where it was not searched, `detections` do not count."""
    time = float(frame.time)
    if searched:
        return tuple(tracker.update(detections, time, frame.image))
    return tuple(tracker.carry(time, frame.image))
