"""Lasting weak detections of a moving camera."""

from typing import Any

import numpy as np
import pytest

from vdet.boxes import Box, Boxes
from vdet.conditions.motion import WeakWatch
from vdet.media import Picture
from vdet.track.track import Track

PICTURE = Picture(np.zeros((360, 640, 3), np.uint8))
LORRY = (250.0, 100.0, 320.0, 180.0)


def spans(
    box: tuple[float, ...] = LORRY,
    *,
    seconds: float = 5.05,
    score: float = 0.15,
    every: int = 1,
    drift: float = 1.0,
    shown: Box | None = None,
) -> list[tuple[float, float]]:
    """Return when detections in every n-th of the frames are reported."""
    watch = WeakWatch()
    tracks = [Track(1, shown, 0.9, "detected")] if shown else []
    for number, time in enumerate(np.arange(0, 8, 0.2).tolist()):
        sides = np.array([box]) + np.array([drift * number, 0] * 2)
        is_detected = time <= seconds and number % every == 0
        detections = Boxes(sides, [score])[[0] if is_detected else []]
        watch.add(time, PICTURE, detections, tracks)
    return [span for finding in watch.findings() for span in finding.spans]


def test_detections_that_last_are_reported() -> None:
    assert spans() == [(0, 5)]
    assert spans(every=2) == [(0, 4)]
    assert spans(seconds=3.05) == [(0, 3)]


@pytest.mark.parametrize(
    "case",
    [
        {"seconds": 2.85},
        {"score": 0.05},
        {"every": 4},
        {"drift": 40.0},
        {"drift": 0.0},
        {"shown": Box(240, 90, 400, 190)},
        {"box": (250.0, 100.0, 262.0, 112.0)},
        {"box": (100.0, 300.0, 540.0, 360.0)},
    ],
    ids=["short", "too weak", "seldom", "passing", "dirt", "shown", "small", "own bonnet"],
)
def test_other_detections_are_not(case: dict[str, Any]) -> None:
    assert spans(**case) == []
