"""Whether the camera moves: planes cut out of one large picture, with known motion."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from vdet.boxes import Image
from vdet.conditions.camera import CameraWatch

WIDTH, HEIGHT = 160, 90
WORLD = cv2.GaussianBlur(
    np.random.default_rng(3).integers(0, 256, (400, 600), np.uint8), (0, 0), 2.5
)
WORLD = np.asarray(cv2.normalize(WORLD, np.empty(0), 0, 255, cv2.NORM_MINMAX), np.uint8)
Place = tuple[float, float, float]
"""Where the camera looks: x, y in planes' pixels, and degrees."""


def view(x: float, y: float, degrees: float) -> Image:
    matrix = cv2.getRotationMatrix2D((300 + x, 200 + y), degrees, 1)
    matrix[:, 2] += np.array((WIDTH / 2 - 300 - x, HEIGHT / 2 - 200 - y))
    noise = np.random.default_rng(int(1000 * (x + y + 500))).integers(-3, 4, (HEIGHT, WIDTH))
    shown = cv2.warpAffine(WORLD, matrix, (WIDTH, HEIGHT))
    return np.asarray(np.clip(shown + noise, 0, 255), np.uint8)


def watched(place: Callable[[float], Place], seconds: float = 20.0) -> CameraWatch:
    watch = CameraWatch()
    for time in np.arange(0, seconds, 0.25).tolist():
        watch.add(time, view(*place(time)), [], is_clear=True)
    return watch


def codes(watch: CameraWatch) -> list[tuple[str, float]]:
    """Return the code and the start of each finding."""
    return [(finding.code, finding.spans[0][0]) for finding in watch.findings()]


def test_a_camera_that_stands_or_trembles_a_little_is_still() -> None:
    watch = watched(lambda time: (0.4 * np.sin(9 * time), 0.3 * np.cos(7 * time), 0.0))
    assert watch.is_still
    assert codes(watch) == []


def test_a_camera_that_is_bumped_stands_differently_from_then_on() -> None:
    watch = watched(lambda time: (0, 0, 0) if time < 8 else (6, -3, 1.5))
    assert codes(watch) == [("camera-moved", 8.0)]
    (finding,) = watch.findings()
    assert finding.spans == ((8.0, 19.75),)
    assert finding.value == pytest.approx(np.hypot(6, 3) / WIDTH, rel=0.15)
    assert "moved at 0:08" in finding.text


@pytest.mark.parametrize(
    "place",
    [
        lambda time: (5 * np.sin(4 * time), 3 * np.cos(5 * time), 0),
        lambda time: (0, 0, 3 * np.sin(3 * time)),
        lambda time: (6 * time, 0, 0),
    ],
    ids=["by hand", "it rolls", "it pans"],
)
def test_a_camera_that_moves_is_reported_from_its_start(place: Callable[[float], Place]) -> None:
    watch = watched(lambda time: place(time - 5) if time >= 5 else place(0), 15.0)
    [(code, start)] = codes(watch)
    assert code == "camera-moves"
    assert start == pytest.approx(5, abs=1)
    assert not watch.is_still


@pytest.mark.parametrize(
    ("back", "span"), [(20, (5, 19.75)), (12, (5, 11.75))], ids=["for good", "and back"]
)
def test_a_camera_that_is_turned_away_is_reported_until_its_view_is_back(
    back: float, span: tuple[float, float]
) -> None:
    watch = watched(lambda time: (180, 80, 0) if 5 <= time < back else (0, 0, 0))
    (finding,) = watch.findings()
    assert (finding.code, finding.spans) == ("camera-moves", (span,))
    assert "to another view" in finding.text


@pytest.mark.parametrize(("end", "is_clear"), [(6, True), (40, False)], ids=["lorry", "fog"])
def test_what_hides_the_view_does_not_move_the_camera(end: float, is_clear: bool) -> None:
    watch = CameraWatch()
    hidden = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH), np.uint8)
    for time in np.arange(0, 50, 0.25).tolist():
        is_hidden = 4 <= time < end
        plane = hidden if is_hidden else view(0, 0, 0)
        watch.add(time, plane, [], is_clear=is_clear or not is_hidden)
    assert codes(watch) == []


def test_heavy_rain_does_not_move_the_camera() -> None:
    watch, rng = CameraWatch(), np.random.default_rng(2)
    for time in np.arange(0, 20, 0.25).tolist():
        plane = view(0, 0, 0) // 2
        for x, y in rng.integers((0, 0), (WIDTH, HEIGHT - 8), (300, 2)):
            plane[y : y + 8, x] = 200
        watch.add(time, plane, [], is_clear=True)
    assert watch.is_still
    assert codes(watch) == []
