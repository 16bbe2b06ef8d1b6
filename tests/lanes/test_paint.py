"""Painted pixels in the top view, and those that may belong to both lines."""

import cv2
import numpy as np
import pytest

from vdet.boxes import Box, Float64Array, Image
from vdet.config.schema import LaneSettings
from vdet.lanes.curves import LaneCurves
from vdet.lanes.paint import (
    HIDDEN,
    MARGIN,
    PAINT,
    find_base,
    hide,
    paint_along,
    paint_mask,
    slide_windows,
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


def test_yellow_is_paint_even_if_it_is_not_lighter_than_the_road() -> None:
    assert mask_of(painted(asphalt((168, 172, 176)), (100, 170, 195)))[:, 149:152].all()


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


def test_a_stripe_much_wider_than_a_line_is_not_paint() -> None:
    assert not mask_of(painted(asphalt(80), WHITE, left=120, width=60))[:, 130:170].any()


def test_sensor_noise_gives_almost_no_paint() -> None:
    noise = np.random.default_rng(0).normal(90, 4, (80, 300, 3))
    assert np.count_nonzero(mask_of(noise.clip(0, 255).astype(np.uint8))) < 20


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


@pytest.mark.parametrize(
    ("lines", "base"),
    [
        ((-1.6, 2.0), (-1.6, 2.0)),
        ((-3.9, -0.4, 3.3), (-0.4, 3.3)),  # the pair around the camera
        ((-1.0, 1.0), None),  # too close together
        ((), None),
    ],
)
def test_the_base_is_where_both_lines_start(
    lines: tuple[float, ...], base: tuple[float, float] | None
) -> None:
    assert find_base(drawn(*constant(*lines)), VIEW) == pytest.approx(base, abs=0.05)


@pytest.mark.parametrize("rows", [slice(None), slice(-40, None)])
def test_sliding_windows_follow_a_bend_by_both_lines_or_one(rows: slice) -> None:
    left, right = LaneCurves(1 / 500, -0.02, -1.85, 1.85, 0).at(VIEW.distances)
    mask = drawn(left) | drawn(right, rows=rows)
    positions = slide_windows(mask, VIEW, (float(left[-1]), float(right[-1])))
    for found, line in zip(positions, (left, right), strict=True):
        assert np.abs(found - line).max() < MARGIN


def test_paint_along_a_line_is_the_middle_of_each_painted_row() -> None:
    line = np.linspace(1.0, 2.0, len(VIEW.distances))
    [paint] = paint_along(drawn(line, rows=slice(10, 90)), VIEW, [line + 0.1], margin=0.3)
    assert (paint.z == VIEW.distances[10:90]).all()
    assert np.abs(paint.x - line[10:90]).max() < 0.02
    [none] = paint_along(drawn(line), VIEW, [line + 0.5], margin=0.3)
    assert len(none.z) == 0


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


def test_rows_that_are_hidden_in_part_are_left_out() -> None:
    mask = drawn(*constant(-1.85, 1.85))
    # from 20 m on, the box hides the inner half of the right line's paint
    half = hide(mask, VIEW, [box_from(-0.5, 1.85, 20)])
    hidden, free = paint_along(half, VIEW, constant(1.85, -1.85), 0.2)
    assert hidden.z.max() < 20.5
    assert hidden.x == pytest.approx(1.85, abs=0.02)
    assert hidden.visible == pytest.approx(len(hidden.z) / len(mask))
    assert len(free.z) == len(mask)
    assert free.visible == 1
