"""Roads drawn with a known horizon, and pictures that show none."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from vdet.boxes import Image
from vdet.detect.svm.windows import find_horizon
from vdet.synthetic.render import frames
from vdet.synthetic.scene import PinholeCamera, demo_scene, empty_road

STEP = 0.01  # between the rows that get votes
RNG = np.random.default_rng(0)


def road(horizon: float, *, curvature: float = 0, lane: int = 0, lanes: int = 3) -> list[Image]:
    """Draw three frames of an empty road."""
    camera = PinholeCamera(640, 360, 600, horizon * 360, 1.3, curvature)
    scene = empty_road(np.random.default_rng(7), camera, lane=lane, lanes=lanes, seed=7)
    return [frame.image for frame in frames(replace(scene, frames=3))]


@pytest.mark.parametrize("horizon", [0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65])
def test_the_lines_of_a_straight_road_meet_at_the_horizon(horizon: float) -> None:
    assert find_horizon(road(horizon)) == pytest.approx(horizon, abs=STEP)


@pytest.mark.parametrize("curvature", [-1 / 600, 1 / 1000])
@pytest.mark.parametrize(("lane", "lanes"), [(0, 2), (1, 2), (1, 3)])
def test_the_road_may_bend_and_the_camera_be_in_any_lane(
    curvature: float, lane: int, lanes: int
) -> None:
    images = road(0.5, curvature=curvature, lane=lane, lanes=lanes)
    assert find_horizon(images) == pytest.approx(0.5, abs=2 * STEP)


def test_the_horizon_is_found_behind_traffic() -> None:
    scene = replace(demo_scene(1, width=640, height=360), frames=5)
    found = find_horizon([frame.image for frame in frames(scene)])
    assert found == pytest.approx(scene.camera.horizon / 360, abs=2 * STEP)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((180, 320, 3), np.uint8),
        np.full((180, 320, 3), 255, np.uint8),
        RNG.integers(0, 256, (180, 320, 3), dtype=np.uint8),
        np.repeat(RNG.integers(0, 256, (1, 320, 3), dtype=np.uint8), 180, axis=0),
        np.zeros((1, 1, 3), np.uint8),
        np.zeros((1, 500, 3), np.uint8),
    ],
    ids=["black", "white", "noise", "upright lines", "a pixel", "a row"],
)
def test_without_lines_there_is_no_horizon(image: Image) -> None:
    assert find_horizon([image]) is None


def fan(*slopes: float) -> Image:
    """Draw lines of these slopes from where they meet in the middle of row 162, down."""
    image = np.full((360, 640, 3), 90, np.uint8)
    for slope in slopes:
        for span in ((60, 110), (130, 180)):
            start, end = (
                (round(320 + np.sign(slope) * x), round(162 + abs(slope) * x)) for x in span
            )
            cv2.line(image, start, end, (240, 240, 240), 3, cv2.LINE_AA)
    return image


RIGHT = (0.3, 0.5, 0.7, 0.9)
LEFT = tuple(-slope for slope in RIGHT)


def test_lines_from_both_sides_are_needed() -> None:
    assert find_horizon([fan(*LEFT, *RIGHT)]) == pytest.approx(0.45, abs=STEP)
    assert find_horizon([fan(*RIGHT)]) is find_horizon([fan(*LEFT)]) is None
