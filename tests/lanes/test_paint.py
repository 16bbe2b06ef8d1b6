"""Painted pixels in the top view, and those that may belong to both lines."""

import cv2
import numpy as np
import pytest

from vdet.boxes import Box, Float64Array, Image
from vdet.config.schema import LaneSettings
from vdet.lanes.paint import (
    HIDDEN,
    PAINT,
    hide,
    paint_mask,
)
from vdet.lanes.top_view import TopView
from vdet.media.images import split_channels

VIEW = TopView(LaneSettings(), 1280, 720)
WHITE, YELLOW = (215, 215, 215), (60, 180, 225)


def asphalt(color: int | tuple[int, int, int]) -> Image:
    image = np.zeros((80, 300, 3), np.uint8)
    image[:] = color
    return image


def painted(image: Image, color: tuple[int, int, int], left: int = 148, width: int = 5) -> Image:
    image[:, left : left + width] = color
    return image


def mask_of(top: Image) -> Image:
    luma, _, blue = split_channels(np.asarray(cv2.cvtColor(top, cv2.COLOR_BGR2YCrCb)))
    return paint_mask(luma, blue)


@pytest.mark.parametrize("gray", [30, 60, 130])
@pytest.mark.parametrize("color", [WHITE, YELLOW])
def test_lines_are_paint_and_the_road_is_not(gray: int, color: tuple[int, int, int]) -> None:
    found = mask_of(painted(asphalt(gray), color))
    assert found.dtype == np.uint8
    assert (found[:, 149:152] == PAINT).all()
    assert not found[:, :144].any()
    assert not found[:, 157:].any()


@pytest.mark.parametrize(
    "image",
    [
        painted(asphalt(40), (120, 120, 120), 150, 150),  # the edge of a shadow
        painted(asphalt(120), (40, 40, 40), 150, 150),
        painted(asphalt(150), (40, 40, 40)),  # a dark stripe
        painted(asphalt(90), WHITE, 0),  # at the border
        np.random.default_rng(0).integers(0, 6, (80, 300, 3), dtype=np.uint8),  # noise in the dark
    ],
)
def test_what_is_not_lighter_than_both_sides_is_not_paint(image: Image) -> None:
    assert not mask_of(image).any()


def drawn(*lines: Float64Array, rows: slice = slice(None)) -> Image:
    """Draw lines, given by x at each row, five columns wide."""
    mask = np.zeros((len(VIEW.distances), len(VIEW.laterals)), np.uint8)
    for line in lines:
        columns = np.rint(VIEW.columns(line)).astype(int)
        for row in range(len(mask))[rows]:
            mask[row, max(0, columns[row] - 2) : columns[row] + 3] = PAINT
    return mask


def constant(*laterals: float) -> list[Float64Array]:
    return [np.full(len(VIEW.distances), lateral) for lateral in laterals]


def box_from(left: float, right: float, distance: float) -> Box:
    """Return the box of a thing on the road that rises far above the horizon."""
    ends = np.array([left, right]), np.array([distance, distance])
    [[x0, y0], [x1, _]] = VIEW.ground_to_frame(*ends)
    return Box.sized(round(x0), 100, round(x1 - x0), round(y0) - 100)


def test_a_vehicle_hides_the_road_behind_it_and_nothing_else() -> None:
    before = drawn(*constant(-1.85, 1.85))
    after = hide(before, VIEW, [box_from(0.5, 2.5, 20)])
    changed = (after != before).any(axis=1)
    assert set(np.unique(after[after != before])) == {HIDDEN}
    assert not changed[VIEW.distances < 19.5].any()
    assert changed[VIEW.distances > 20.5].all()
