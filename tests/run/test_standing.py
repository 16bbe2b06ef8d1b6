"""What stands before a fixed camera: it is shown once it moves or scores high."""

from fractions import Fraction
from pathlib import Path
from unittest.mock import Mock

from boxing import moved_to
from red_cars import road
from vdet.boxes import NO_BOXES, Box
from vdet.conditions.watch import Conditions
from vdet.media import Frame, Picture
from vdet.run.result import FrameResult
from vdet.run.steps import StandingStep
from vdet.track.track import Track

FRAMES = 10
SIGN, CAR = Box.sized(10, 10, 20, 20), Box.sized(100, 50, 40, 30)


def shown(*, moves: bool) -> dict[int, list[int]]:
    """Return the frames that show a sign, a car that drives off, a parked one, and a flicker."""
    step = StandingStep(Mock(Conditions, moves=moves))
    frames: dict[int, list[int]] = {1: [], 2: [], 3: [], 4: []}
    for index in range(FRAMES):
        driven = moved_to(CAR, 100 + 3 * index, 50)
        tracks = (
            Track(1, moved_to(SIGN, 10 + index % 2, 10), 0.55, "detected"),
            Track(2, driven, 0.45, "detected"),
            Track(3, moved_to(CAR, 100, 110), 0.9, "detected"),
            Track(4, moved_to(CAR, 160, 110), 0.7 if index == 5 else 0.5, "detected"),
        )
        frame = Frame(index, Fraction(index), Picture(road()))
        for track in step.apply(FrameResult(Path("a.mp4"), frame, NO_BOXES, tracks)).tracks:
            frames[track.id].append(index)
    return frames


def test_a_fixed_camera_shows_what_has_moved_or_scored_high() -> None:
    every = list(range(FRAMES))
    assert shown(moves=False) == {1: [], 2: every[3:], 3: every, 4: every[5:]}


def test_a_camera_that_moves_shows_all() -> None:
    assert shown(moves=True) == {number: list(range(FRAMES)) for number in (1, 2, 3, 4)}
