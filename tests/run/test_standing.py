"""Tracks that do not move are hidden if the camera is fixed."""

from fractions import Fraction
from pathlib import Path
from unittest.mock import Mock

import numpy as np

from boxing import moved_to
from vdet.boxes import NO_BOXES, Box
from vdet.conditions.watch import Conditions
from vdet.config.classes import UNKNOWN
from vdet.media import Frame, Picture
from vdet.run.steps import FrameResult, StandingStep
from vdet.track.track import Track

FRAMES, WIDTH = 10, 320
PICTURE = Picture(np.zeros((240, WIDTH, 3), np.uint8))
SIGN, CAR = Box.sized(10, 10, 20, 20), Box.sized(100, 50, 40, 30)


def shown(*, is_moving: bool) -> list[list[int]]:
    """Return the frames that show each of six tracks.

    They are a sign, a car that drives off, a parked one, one that once scores high, one that waits
    where the second one drove, and a sign that scores high, but of which the classes disagree.
    """
    step = StandingStep(Mock(Conditions, is_moving=is_moving), 0.6, WIDTH)
    frames: list[list[int]] = [[] for _ in range(6)]
    for index in range(FRAMES):
        tracks = (
            Track(0, moved_to(SIGN, 10 + index % 2, 10), 0.55, "detected"),
            Track(1, moved_to(CAR, 100 + 3 * index, 50), 0.45, "detected"),
            Track(2, moved_to(CAR, 100, 110), 0.9, "detected"),
            Track(3, moved_to(CAR, 160, 110), 0.7 if index == 5 else 0.5, "detected"),
            Track(4, moved_to(CAR, 120, 60), 0.5, "detected"),
            Track(5, moved_to(SIGN, 40, 10), 0.8, "detected", UNKNOWN),
        )
        frame = Frame(index, Fraction(index), PICTURE)
        for track in step.apply(FrameResult(Path("a.mp4"), frame, NO_BOXES, tracks)).tracks:
            frames[track.id].append(index)
    return frames


def test_a_fixed_camera_shows_what_moves_scores_high_or_is_where_others_drove() -> None:
    every = list(range(FRAMES))
    assert shown(is_moving=False) == [[], every[3:], every, every[5:], every[3:], []]


def test_a_moving_camera_shows_all() -> None:
    assert shown(is_moving=True) == [list(range(FRAMES))] * 6
