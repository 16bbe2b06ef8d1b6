"""What moves before a fixed camera and has no track: planes with one shape that moves."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from vdet.boxes import Box, Image
from vdet.conditions.motion import MotionWatch

WIDTH, HEIGHT = 160, 90
ROAD = np.random.default_rng(1).integers(70, 130, (HEIGHT, WIDTH)).astype(np.float32)
Place = Callable[[float], Box | None]
ACROSS: Place = lambda time: Box.sized(20 * time - 20, 30, 24, 14)  # noqa: E731


def plane(box: Box | None, soft: float = 0.0, level: float = 60.0) -> Image:
    shape = np.zeros_like(ROAD)
    if box:
        box.cut(shape)[:] = level
    if soft:
        shape = np.asarray(cv2.GaussianBlur(shape, (0, 0), soft), np.float32)
    shown = np.clip(cv2.GaussianBlur(ROAD, (0, 0), 1.5) + shape, 0, 255)
    return np.asarray(shown, np.uint8)


def watched(
    place: Place, soft: float = 0.0, level: float = 60.0, *, tracked: Place = lambda _: None
) -> MotionWatch:
    watch = MotionWatch({"gate": ((0.5, 0.0), (0.5, 1.0))})
    for time in np.arange(0, 10, 0.2).tolist():
        box = tracked(time)
        boxes = {1: box} if box and box.clipped(WIDTH, HEIGHT) else {}
        watch.add(time, plane(place(time), soft, level), boxes, is_steady=True)
    return watch


def test_a_vehicle_that_was_not_found_is_said_with_its_time_and_its_line() -> None:
    watch = watched(ACROSS)
    [finding] = watch.findings()
    assert (finding.code, finding.severity, finding.value) == ("nothing-found", "warning", 1.0)
    assert "at least 1 thing moved here, 1 across gate" in finding.text
    assert np.allclose(finding.spans, [(0, 9)], atol=1)


@pytest.mark.parametrize(
    ("place", "soft"),
    [
        (lambda time: Box.sized(12 * time, 30, 6, 20), 0.0),
        (ACROSS, 6.0),
        (lambda time: Box.sized(20 * time, 5, 14, 10) if 2 <= time < 3.2 else None, 0.0),
    ],
    ids=["a person is upright", "a cloud is soft", "one branch moves a little"],
)
def test_what_is_no_vehicle_is_only_noted(place: Place, soft: float) -> None:
    [finding] = watched(place, soft, 120.0).findings()
    assert (finding.code, finding.severity) == ("nothing-found", "note")


@pytest.mark.parametrize(
    "place",
    [lambda _: None, lambda _: Box.sized(60, 30, 24, 14)],
    ids=["an empty road", "what stands"],
)
def test_a_still_scene_has_no_doubt(place: Place) -> None:
    [finding] = watched(place).findings()
    assert str(finding) == "no vehicle was found, and nothing moved [nothing-found]"
    assert finding.severity == "note"


def test_what_is_tracked_is_explained_whatever_its_class() -> None:
    assert watched(ACROSS, tracked=ACROSS).findings() == []


def test_rain_is_no_vehicle() -> None:
    watch, rng = MotionWatch({}), np.random.default_rng(2)
    for time in np.arange(0, 10, 0.2).tolist():
        drops = plane(None)
        for x, y in rng.integers((0, 0), (WIDTH, HEIGHT - 6), (300, 2)):
            drops[y : y + 6, x] = 220
        watch.add(time, drops, {}, is_steady=True)
    assert {finding.severity for finding in watch.findings()} <= {"note"}
