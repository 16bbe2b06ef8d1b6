"""Lanes on generated roads, compared with the lines that were drawn."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from lanes.roads import drive, make_road, settings_for
from vdet.boxes import Float64Array, Image
from vdet.config.schema import LaneSettings
from vdet.lanes.road import CARRY, Lane, RoadFinder
from vdet.media import Picture
from vdet.synthetic import LaneLine, Light, PinholeCamera, Renderer, Shadow

SHADOWS = tuple(
    Shadow(station, 8.0, 0.45, dappled)
    for station, dappled in ((0.0, True), (14.0, False), (30.0, True), (44.0, False))
)


def lateral_ends(line: Float64Array, camera: PinholeCamera) -> tuple[float, float]:
    """Return the lateral position of a line at its nearest and farthest point, metres."""
    distance = camera.focal * camera.above_ground / (line[[0, -1], 1] - camera.horizon)
    lateral = (line[[0, -1], 0] - camera.width / 2) * distance / camera.focal
    near, far = (lateral - camera.curvature * distance**2 / 2).tolist()
    return near, far


def check(lane: Lane | None, camera: PinholeCamera) -> None:
    assert lane is not None
    for line, truth in ((lane.left, -1.85), (lane.right, 1.85)):
        near, far = lateral_ends(line, camera)
        assert near == pytest.approx(truth, abs=0.10)
        assert far == pytest.approx(truth, abs=0.30)
    assert lane.width == pytest.approx(3.7, abs=0.10)
    assert lane.offset == pytest.approx(0, abs=0.10)
    if camera.curvature:
        assert lane.curvature == pytest.approx(camera.curvature, rel=0.2)
        assert lane.radius == pytest.approx(1 / abs(camera.curvature), rel=0.25)
    else:
        assert lane.radius is None


LIGHT = Light(noise=3.0, shadows=SHADOWS)
PALE = 129, 128, 126
"""The colour of a worn line: 70 % of it is asphalt."""
DASHED = LaneLine(-1.85, dash=3.0), LaneLine(1.85, dash=3.0)
WORN = LaneLine(-1.85, PALE), LaneLine(1.85, PALE, dash=3.0)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"curvature": -1 / 2000},
        {"curvature": 1 / 800},
        {"curvature": 1 / 300},
        {"curvature": -1 / 300},
        {"lines": DASHED, "curvature": 1 / 1000},
        {"lines": DASHED, "curvature": -1 / 400},
        {"lines": WORN, "curvature": -1 / 800},
        {"light": LIGHT},  # bands of shadow across the road
        {"light": LIGHT, "curvature": -1 / 500},
        {"light": LIGHT, "curvature": 1 / 1000, "asphalt": (170, 178, 182)},  # pale concrete
        {"size": (640, 360), "curvature": -1 / 700},
        {"size": (1920, 1080), "curvature": -1 / 700},
    ],
)
def test_finds_lanes_of_all_kinds(changes: dict[str, Any]) -> None:
    scene = make_road(**changes)
    lanes = drive(scene)
    assert all(lanes)
    check(lanes[-1], scene.camera)


@pytest.mark.parametrize("missing", [-1.85, 1.85])
def test_no_lane_is_found_if_one_line_was_never_seen(missing: float) -> None:
    scene = make_road(lines=(LaneLine(-missing),))
    assert drive(scene) == [None] * scene.frames


def test_a_verge_is_no_line() -> None:
    verge = (LaneLine(1.85 + 0.5 * number, PALE, dash=3.0) for number in range(4))
    scene = make_road(lines=(LaneLine(-1.85), *verge))
    assert drive(scene) == [None] * scene.frames


@pytest.mark.parametrize("missing", [-1.85, 1.85])
def test_a_line_that_ends_is_kept_for_a_while_and_then_the_lane_is_lost_until_it_reappears(
    missing: float,
) -> None:
    whole = make_road(curvature=1 / 900, size=(640, 360))
    one = (LaneLine(-missing),)
    half = make_road(curvature=1 / 900, size=(640, 360), lines=one, frames=CARRY + 3)
    lanes = drive(whole, half, whole)
    seen = whole.frames + half.frames
    check(lanes[seen - 4], whole.camera)
    assert lanes[seen - 3 : seen] == [None] * 3
    check(lanes[-1], whole.camera)  # found again


def test_a_lane_change_ends_in_the_other_lane() -> None:
    moves = np.arange(0, 3.75, 0.15)  # metres a frame; a quick change at ten frames a second
    scenes = []
    for moved in moves.tolist():
        lines = tuple(LaneLine(lateral - moved) for lateral in (-1.85, 1.85, 5.55))
        scenes.append(make_road(lines=lines, size=(640, 360), frames=1))
    offsets = np.array([lane.offset for lane in drive(*scenes) if lane])
    lag = np.mod(moves - offsets + 1.85, 3.7) - 1.85
    assert np.abs(lag).max() < 0.3
    assert np.abs(offsets).max() < 2.0
    assert offsets[-1] < 0 < offsets[1]


def test_a_pitching_camera_keeps_the_lane_and_its_width() -> None:
    scene = make_road(curvature=1 / 800)
    camera = scene.camera
    finder = RoadFinder(None, settings_for(camera), camera.width, camera.height)
    for shift in (0, 3, 6, 8, 4, -3, -6, -3):  # pixels by which the horizon moves
        pitched = replace(camera, horizon=camera.horizon + shift)
        view = finder.observe(Picture(Renderer(replace(scene, camera=pitched)).image(0)))
        check(finder.update(view).lane, pitched)


def grey() -> Image:
    return np.full((720, 1280, 3), 90, np.uint8)


def noise() -> Image:
    return np.random.default_rng(0).integers(0, 256, (720, 1280, 3), dtype=np.uint8)


def blobs() -> Image:
    return np.asarray(cv2.resize(noise()[:45, :80], (1280, 720)), np.uint8)


def room() -> Image:
    """Draw forty rectangles."""
    rng, image = np.random.default_rng(0), grey()
    for _ in range(40):
        x, y, width, height = rng.integers(0, (1280, 720, 400, 400)).tolist()
        color = rng.integers(0, 256, 3).tolist()
        cv2.rectangle(image, (x, y), (x + width, y + height), color, cv2.FILLED)
    return image


@pytest.mark.parametrize("draw", [grey, noise, blobs, room])
def test_a_picture_without_a_lane_has_none(draw: Callable[[], Image]) -> None:
    finder = RoadFinder(None, LaneSettings(), 1280, 720)
    for _ in range(3):
        assert finder.update(finder.observe(Picture(draw()))).lane is None
