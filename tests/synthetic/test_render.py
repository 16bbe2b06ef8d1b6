from dataclasses import replace

import numpy as np
import pytest

from synthetic.scenes import make_scene
from vdet.synthetic.render import Renderer
from vdet.synthetic.scene import Shadow, demo_scene


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
