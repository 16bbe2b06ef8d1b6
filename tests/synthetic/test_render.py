"""Drawn scenes, and the truth of their vehicles."""

import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthetic.scenes import make_scene, parked
from vdet.boxes import Box
from vdet.media.reader import VideoReader
from vdet.synthetic import (
    NEAR,
    Renderer,
    Scene,
    Shadow,
    TrueBox,
    Waypoint,
    beyond_near,
    demo_scene,
    frames,
    must_be_found,
    true_boxes,
    write_clip,
    write_truth,
)


def test_the_same_seed_gives_the_same_pixels_in_any_order() -> None:
    first, second = (Renderer(demo_scene(4, width=320, height=180)) for _ in range(2))
    forward = [first.image(index) for index in (0, 100, 200)]
    backward = [second.image(index) for index in (200, 100, 0)]
    assert np.array_equal(forward, backward[::-1])


def test_the_road_moves_and_repeats_after_its_period() -> None:
    renderer = Renderer(replace(make_scene(size=(640, 360)), speed=50.0))
    start = renderer.image(0)
    assert not np.array_equal(start, renderer.image(1))
    difference = start.astype(int) - renderer.image(300)  # 600 m: 3 periods, 50 dashes
    assert np.abs(difference).max() <= 1


@pytest.mark.parametrize("curvature", [-1 / 400, 0.0, 1 / 400])
def test_a_solid_line_is_drawn_where_the_projection_puts_it(curvature: float) -> None:
    scene = make_scene(curvature=curvature)
    camera, image = scene.camera, Renderer(scene).image(0)
    for row in (440, 460, 500, 580):
        ahead = camera.focal * camera.above_ground / (row - camera.horizon)
        [[u, _]] = camera.project(np.array([[-1.85, 0.0, ahead]]))
        left = round(u) - 25
        brightness = image[row, left : left + 51].astype(float).sum(axis=1)
        bright = np.flatnonzero(brightness > (brightness.min() + brightness.max()) / 2)
        assert left + bright.mean() == pytest.approx(u, abs=1)


def test_a_shadow_darkens_the_road_where_it_lies() -> None:
    scene = make_scene()
    shadow = Shadow(station=10.0, length=5.0, strength=0.5, dappled=False)
    shaded = replace(scene, light=replace(scene.light, shadows=(shadow,)))
    ratio = Renderer(shaded).image(0).astype(float) / np.maximum(Renderer(scene).image(0), 1)
    for ahead, expected in ((8.0, 1.0), (12.0, 0.5), (20.0, 1.0)):
        [[u, v]] = scene.camera.project(np.array([[0.0, 0.0, ahead]])).round().astype(int)
        assert ratio[v, u - 20 : u + 20].mean() == pytest.approx(expected, abs=0.05)


SIZES = [(1280, 720), (640, 360), (1242, 375)]


def drawn(scene: Scene) -> npt.NDArray[np.bool_]:
    """Return the pixels that differ from those of the same road without vehicles."""
    empty = Renderer(replace(scene, vehicles=())).image(0)
    return np.asarray(cv2.absdiff(Renderer(scene).image(0), empty).max(axis=2) > 12)


def drawn_box(scene: Scene) -> Box:
    return Box.sized(*cv2.boundingRect(drawn(scene).astype(np.uint8)))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(("ahead", "lateral"), [(9.0, 0.0), (12.0, 3.7), (25.0, -3.7)])
def test_the_true_box_bounds_what_is_drawn(
    size: tuple[int, int], ahead: float, lateral: float
) -> None:
    scene = make_scene(parked(1, ahead, lateral), size=size)
    [found] = true_boxes(scene, 0)
    assert found.box.pixels == pytest.approx(drawn_box(scene).pixels, abs=2)
    assert found.hidden == 0


@pytest.mark.parametrize("heading", [math.pi / 2, math.pi, -2.0])
def test_a_vehicle_may_drive_in_any_direction(heading: float) -> None:
    turned = replace(parked(1, 15.0, 0.0), path=(Waypoint(0.0, 18.0, -1.0, heading),))
    [found] = true_boxes(make_scene(turned), 0)
    assert found.box.pixels == pytest.approx(drawn_box(make_scene(turned)).pixels, abs=2)
    length = abs(math.sin(heading)) * turned.body.length
    assert found.box.width / found.box.height > 1 + length / 5


def test_hidden_is_the_fraction_of_the_farther_vehicle_that_the_nearer_one_covers() -> None:
    near, far = parked(1, 12.0, 0.0), parked(2, 30.0, 2.0)
    front, back = drawn(make_scene(near)), drawn(make_scene(far))
    covered = (front & back).sum() / back.sum()
    assert 0.2 < covered < 0.8
    found = true_boxes(make_scene(near, far), 0)[1]
    assert found.hidden == pytest.approx(covered, abs=0.05)


@pytest.mark.parametrize(
    ("width", "height", "hidden", "expected"),
    [(40, 24, 0.5, True), (39, 24, 0.0, False), (40, 23, 0.0, False), (90, 60, 0.51, False)],
)
def test_a_vehicle_must_be_found_if_it_is_large_and_half_of_it_is_not_hidden(
    width: int, height: int, hidden: float, expected: bool
) -> None:
    vehicle = TrueBox(1, Box.sized(0, 0, width, height), hidden)
    assert must_be_found(vehicle, 720) is expected


@pytest.fixture
def scene() -> Scene:
    """Three frames: a vehicle in full view, one hidden behind it, one too small."""
    vehicles = parked(1, 10.0, 0.0), parked(2, 30.0, 0.0), parked(3, 90.0, 9.0)
    return make_scene(*vehicles, size=(640, 360), frames=3)


def test_the_video_shows_the_rendered_frames(tmp_path: Path, scene: Scene) -> None:
    write_clip(tmp_path / "road.mp4", scene)
    with VideoReader(tmp_path / "road.mp4") as reader:
        read = list(reader)
    assert [frame.time for frame in read] == [0, Fraction(1, 25), Fraction(2, 25)]
    for frame, drawn in zip(read, frames(scene), strict=True):
        assert np.abs(frame.image.astype(int) - drawn.image).mean() < 4


def test_truth_is_in_the_columns_of_motchallenge_with_what_is_hidden_or_small_ignored(
    tmp_path: Path, scene: Scene
) -> None:
    write_truth(tmp_path / "gt.txt", scene)
    rows = np.loadtxt(tmp_path / "gt.txt", delimiter=",")
    expected = [
        [index + 1, number, box.x1 + 1, box.y1 + 1, box.width, box.height, flag, 3, visible]
        for index in range(3)
        for number, flag, visible in ((1, 1, 1), (2, 0, 0), (3, 0, 1))
        for box in [true_boxes(scene, index)[number - 1].box]
    ]
    assert rows == pytest.approx(np.array(expected), abs=0.01)


metres = st.floats(-50, 50)


@given(st.lists(st.tuples(metres, metres, metres), min_size=3, max_size=6))
def test_cutting_leaves_nothing_nearer_than_near(corners: list[tuple[float, ...]]) -> None:
    polygon = np.array(corners)
    kept = beyond_near(polygon)
    assert (kept[:, 2] >= NEAR - 1e-9).all()
    assert len(kept) >= (polygon[:, 2] >= NEAR).sum()
