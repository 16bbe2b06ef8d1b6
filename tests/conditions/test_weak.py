"""Weak detections that last, before a camera that moves."""

import numpy as np
import pytest

from vdet.boxes import Boxes, Float64Array
from vdet.conditions.weak import WeakWatch
from vdet.media import Picture

PICTURE = Picture(np.zeros((360, 640, 3), np.uint8))
LORRY = (250.0, 100.0, 320.0, 180.0)
NONE = np.empty((0, 4))


def spans(
    box: tuple[float, ...] = LORRY,
    *,
    seconds: float = 5.0,
    score: float = 0.15,
    every: int = 1,
    drift: float = 0.0,
    shown: Float64Array = NONE,
) -> list[tuple[float, float]]:
    """Return when a detection, seen in every n-th of the frames, is reported."""
    watch, rng = WeakWatch(), np.random.default_rng(1)
    for number, time in enumerate(np.arange(0, 8, 0.2).tolist()):
        sides = np.array([box]) + rng.uniform(-3, 3, 4) + np.array([drift * number, 0] * 2)
        visible = time <= seconds and number % every == 0
        detections = Boxes(sides, [score])[[0] if visible else []]
        watch.add(time, PICTURE, detections, shown)
    return [span for finding in watch.findings() for span in finding.spans]


def test_what_lasts_is_reported() -> None:
    assert spans() == [(0.0, 5.0)]
    assert spans(every=2) == [(0.0, 24 * 0.2)]


@pytest.mark.parametrize(
    "case",
    [
        {"seconds": 2.0},
        {"score": 0.05},
        {"every": 4},
        {"drift": 40.0},  # passes by
        {"shown": np.array([(240.0, 90.0, 330.0, 190.0)])},
        {"box": (250.0, 100.0, 262.0, 112.0)},  # far
        {"box": (100.0, 300.0, 540.0, 360.0)},  # the bonnet of the camera's own vehicle
    ],
    ids=["short", "too weak", "seldom", "moving", "shown", "small", "bonnet"],
)
def test_other_detections_are_not(case: dict[str, float]) -> None:
    assert spans(**case) == []  # type: ignore[arg-type]
