"""Small scenes for the motion tracker: rectangles in a frame, and what is shown of them."""

from collections.abc import Iterable, Sequence

from vdet.config.schema import MotionSettings
from vdet.detect.svm.heat import Region
from vdet.geometry import Box
from vdet.track.motion import MotionTracker
from vdet.track.track import Track

WIDTH, HEIGHT = 1280, 720
_STRONG = MotionSettings().strong
CLEAR, WEAK, GLIMMER = 1.5 * _STRONG, 0.5 * _STRONG, 0.1 * _STRONG
"""Peaks of a vehicle that is seen clearly, of one that is hardly seen, and of next to nothing."""


def region(box: Box, peak: float = CLEAR) -> Region:
    return Region(box, box.center, peak)


def moving(box: Box, dx: float = 0, dy: float = 0, frames: int = 30) -> list[Box]:
    """Give the places of a box that moves steadily."""
    return [box.moved_to(round(box.x + n * dx), round(box.y + n * dy)) for n in range(frames)]


def inside(box: Box) -> Box:
    return box.clipped(WIDTH, HEIGHT)


def follow(frames: Iterable[Sequence[Region | Box]], **settings: float) -> list[list[Track]]:
    """Track regions (a box stands for one that is seen clearly); give what is shown in each."""
    tracker = MotionTracker(MotionSettings.model_validate(settings), WIDTH, HEIGHT)
    return [
        tracker.update([each if isinstance(each, Region) else region(each) for each in frame])
        for frame in frames
    ]


def ids(shown: Iterable[Sequence[Track]]) -> set[int]:
    return {track.id for tracks in shown for track in tracks}


def first_shown(shown: Sequence[Sequence[Track]]) -> int:
    """Return how many frames went by before the first that shows something."""
    return next(number for number, tracks in enumerate(shown) if tracks)


def id_at(tracks: Sequence[Track], box: Box) -> int:
    """Return the id of the only track that overlaps `box` by half or more."""
    (track,) = [track for track in tracks if track.box.iou(box) >= 0.5]
    return track.id
