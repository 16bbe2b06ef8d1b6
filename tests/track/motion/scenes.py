"""Small scenes for the motion tracker: boxes in a frame, and what is shown of them."""

from collections.abc import Iterable, Sequence

from boxing import moved_to
from vdet.boxes import NO_BOXES, Box, Boxes
from vdet.config.schema import MotionTrackerSettings
from vdet.track.motion.tracker import MotionTracker
from vdet.track.track import Track

WIDTH, HEIGHT = 1280, 720
RATE = 25
CLEAR, WEAK, FAINT = 1.0, 0.5, 0.1
"""Scores of a vehicle that is seen clearly, of one that is hardly seen, and of next to nothing."""

Scored = tuple[Box, float]


def frames(seconds: float, rate: int = RATE) -> int:
    """Return how many whole frames there are in this time."""
    return int(seconds * rate + 1e-6)


def moving(box: Box, dx: float = 0, dy: float = 0, frames: int = 30) -> list[Box]:
    """Give the places of a box that moves steadily, so many pixels a frame."""
    return [moved_to(box, round(box.x1 + n * dx), round(box.y1 + n * dy)) for n in range(frames)]


def inside(box: Box) -> Box:
    return box.clipped(WIDTH, HEIGHT)


def detections(found: Sequence[Scored | Box]) -> Boxes:
    """Give the detections at these places; a box without a score is seen clearly."""
    scored = [(item, CLEAR) if isinstance(item, Box) else item for item in found]
    scored = [(box, score) for box, score in scored if box.area]
    if not scored:
        return NO_BOXES
    corners = [(box.x1, box.y1, box.x2, box.y2) for box, _ in scored]
    return Boxes(corners, [score for _, score in scored])


def follow(
    clip: Iterable[Sequence[Scored | Box]], rate: float = RATE, **settings: float
) -> list[list[Track]]:
    """Track the detections of each frame; give the tracks shown in each."""
    tracker = MotionTracker(MotionTrackerSettings.model_validate(settings), WIDTH, HEIGHT)
    return [tracker.update(detections(found), n / rate) for n, found in enumerate(clip)]


def ids(shown: Iterable[Sequence[Track]]) -> set[int]:
    return {track.id for tracks in shown for track in tracks}


def first_shown(shown: Sequence[Sequence[Track]]) -> int:
    """Return the number of frames before the first one that shows something."""
    return next(number for number, tracks in enumerate(shown) if tracks)


def id_at(tracks: Sequence[Track], box: Box) -> int:
    """Return the id of the only track that overlaps `box` by half or more."""
    (track,) = [track for track in tracks if track.box.iou(box) >= 0.5]
    return track.id
