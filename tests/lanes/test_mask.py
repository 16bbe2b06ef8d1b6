"""Which pixels from above are paint."""

import cv2
import numpy as np
import pytest

from vdet.config.lanes import MaskSettings
from vdet.lanes.mask import lane_mask
from vdet.media.images import Image

ACROSS = 30.0
WHITE, YELLOW = (215, 215, 215), (60, 180, 225)


def road(color: int | tuple[int, int, int]) -> Image:
    image = np.zeros((80, 300, 3), np.uint8)
    image[:] = color
    return image


def paint(image: Image, color: tuple[int, int, int], left: int = 148, width: int = 5) -> Image:
    image[:, left : left + width] = color
    return image


def mask(image: Image) -> Image:
    return lane_mask(image, MaskSettings(), ACROSS)


@pytest.mark.parametrize("asphalt", [30, 60, 90, 130])
@pytest.mark.parametrize("color", [WHITE, YELLOW])
def test_lines_are_paint_and_the_road_is_not(asphalt: int, color: tuple[int, int, int]) -> None:
    found = mask(paint(road(asphalt), color))
    assert found.dtype == np.uint8
    assert (found[:, 149:152] == 255).all()
    assert not found[:, :144].any()
    assert not found[:, 157:].any()


def test_yellow_is_paint_even_where_it_is_no_lighter_than_the_road() -> None:
    pale = road((168, 172, 176))
    found = mask(paint(pale, (100, 170, 195)))
    assert found[:, 149:152].all()


def test_a_line_in_shadow_is_paint() -> None:
    image = paint(road(90), WHITE)
    image[20:60] = (image[20:60] * 0.3).astype(np.uint8)
    assert mask(image)[:, 149:152].all()


@pytest.mark.parametrize("levels", [(40, 120), (120, 40), (130, 190)])
def test_the_edge_of_a_shadow_or_of_another_surface_is_none(levels: tuple[int, int]) -> None:
    image = road(levels[0])
    image[:, 150:] = levels[1]
    assert not mask(image).any()


def test_a_dark_stripe_is_none() -> None:
    assert not mask(paint(road(150), (40, 40, 40))).any()


def test_something_much_wider_than_a_line_is_none() -> None:
    assert not mask(paint(road(80), WHITE, left=120, width=60))[:, 130:170].any()


def test_noise_of_a_sensor_is_hardly_any() -> None:
    noise = np.random.default_rng(0).normal(90, 4, (80, 300, 3))
    assert np.count_nonzero(mask(noise.clip(0, 255).astype(np.uint8))) < 20


def test_darkness_with_noise_is_none() -> None:
    noise = np.random.default_rng(0).integers(0, 6, (80, 300, 3), dtype=np.uint8)
    assert not mask(noise).any()


def test_paint_at_the_picture_s_border_is_left_out() -> None:
    image = road(90)
    cv2.rectangle(image, (0, 0), (4, 80), WHITE, cv2.FILLED)
    assert not mask(image).any()
