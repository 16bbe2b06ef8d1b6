"""Painted pixels in the top view, and those that may belong to both lines."""

import cv2
import numpy as np
import pytest

from vdet.boxes import Box, Float64Array
from vdet.config.lanes import LaneSettings
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
from vdet.media.images import Image

SETTINGS = LaneSettings()
WHITE, YELLOW = (215, 215, 215), (60, 180, 225)


def asphalt(color: int | tuple[int, int, int]) -> Image:
    image = np.zeros((80, 300, 3), np.uint8)
    image[:] = color
    return image


def painted(image: Image, color: tuple[int, int, int], left: int = 148, width: int = 5) -> Image:
    image[:, left : left + width] = color
    return image


def mask_of(image: Image) -> Image:
    return paint_mask(image)


@pytest.mark.parametrize("gray", [30, 60, 90, 130])
@pytest.mark.parametrize("color", [WHITE, YELLOW])
def test_lines_are_paint_and_the_road_is_not(gray: int, color: tuple[int, int, int]) -> None:
    found = mask_of(painted(asphalt(gray), color))
    assert found.dtype == np.uint8
    assert (found[:, 149:152] == 255).all()
    assert not found[:, :144].any()
    assert not found[:, 157:].any()


def test_yellow_is_paint_even_if_it_is_not_lighter_than_the_road() -> None:
    pale = asphalt((168, 172, 176))
    found = mask_of(painted(pale, (100, 170, 195)))
    assert found[:, 149:152].all()


@pytest.mark.parametrize("levels", [(40, 120), (120, 40), (130, 190)])
def test_the_edge_of_a_shadow_or_of_another_surface_is_not_paint(levels: tuple[int, int]) -> None:
    image = asphalt(levels[0])
    image[:, 150:] = levels[1]
    assert not mask_of(image).any()


def test_a_stripe_much_wider_than_a_line_is_not_paint() -> None:
    assert not mask_of(painted(asphalt(80), WHITE, left=120, width=60))[:, 130:170].any()


def test_sensor_noise_gives_almost_no_paint() -> None:
    noise = np.random.default_rng(0).normal(90, 4, (80, 300, 3))
    assert np.count_nonzero(mask_of(noise.clip(0, 255).astype(np.uint8))) < 20


def test_paint_at_the_border_is_left_out() -> None:
    image = asphalt(90)
    cv2.rectangle(image, (0, 0), (4, 80), WHITE, cv2.FILLED)
    assert not mask_of(image).any()


@pytest.fixture
def top_view() -> TopView:
    return TopView(SETTINGS, 1280, 720)


def drawn(top_view: TopView, *lines: Float64Array, rows: slice = slice(None)) -> Image:
    """Draw lines, given by x at each row, five columns wide."""
    mask = np.zeros((len(top_view.distances), len(top_view.laterals)), np.uint8)
    for line in lines:
        columns = np.rint(top_view.columns(line)).astype(int)
        for row in range(len(mask))[rows]:
            mask[row, max(0, columns[row] - 2) : columns[row] + 3] = 255
    return mask


def constant(top_view: TopView, *laterals: float) -> list[Float64Array]:
    return [np.full(len(top_view.distances), lateral) for lateral in laterals]


def test_the_base_is_the_pair_of_lines_around_the_camera(top_view: TopView) -> None:
    mask = drawn(top_view, *constant(top_view, -3.9, -0.4, 3.3))
    assert find_base(mask, top_view, SETTINGS) == pytest.approx((-0.4, 3.3), abs=0.05)


def test_lines_too_close_together_have_no_base(top_view: TopView) -> None:
    assert find_base(drawn(top_view, *constant(top_view, -1.0, 1.0)), top_view, SETTINGS) is None


def test_sliding_windows_follow_a_bend(top_view: TopView) -> None:
    lines = LaneCurves(bend=1 / 500, heading=-0.02, left=-1.85, right=1.85, pitch=0).at(
        top_view.distances
    )
    base = float(lines[0][-1]), float(lines[1][-1])
    positions = slide_windows(drawn(top_view, *lines), top_view, base)
    for found, line in zip(positions, lines, strict=True):
        assert np.abs(found - line).max() < MARGIN


def test_a_window_without_paint_moves_with_the_other_line(top_view: TopView) -> None:
    left, right = LaneCurves(1 / 500, 0, -1.85, 1.85, 0).at(top_view.distances)
    mask = drawn(top_view, left) | drawn(top_view, right, rows=slice(-40, None))
    positions = slide_windows(mask, top_view, (float(left[-1]), float(right[-1])))
    assert np.abs(positions[1] - right).max() < MARGIN


def test_paint_along_a_line_is_the_middle_of_each_row(top_view: TopView) -> None:
    line = np.linspace(1.0, 2.0, len(top_view.distances))
    paint = paint_along(drawn(top_view, line), top_view, line + 0.1, margin=0.3)
    assert (paint.z == top_view.distances).all()
    assert np.abs(paint.x - line).max() < 0.02


@pytest.mark.parametrize("lateral", [-4.8, 4.8, -20.0, 20.0])
def test_paint_along_a_line_outside_the_top_view_stays_inside_it(
    top_view: TopView, lateral: float
) -> None:
    mask = np.full((len(top_view.distances), len(top_view.laterals)), 255, np.uint8)
    paint = paint_along(mask, top_view, constant(top_view, lateral)[0], margin=0.3)
    assert ((paint.x >= top_view.laterals[0]) & (paint.x <= top_view.laterals[-1])).all()


class TestHiddenPaint:
    VIEW = TopView(SETTINGS, 1280, 720)

    def box_from(self, left: float, right: float, distance: float) -> Box:
        """Return the box of a thing on the road that rises far above the horizon."""
        ends = np.array([left, right]), np.array([distance, distance])
        [[x0, y0], [x1, _]] = self.VIEW.ground_to_frame(*ends)
        return Box.sized(round(x0), 100, round(x1 - x0), round(y0) - 100)

    def mask(self) -> Image:
        mask = np.zeros((len(self.VIEW.distances), len(self.VIEW.laterals)), np.uint8)
        for lateral in (-1.85, 1.85):
            mask[:, np.abs(self.VIEW.laterals - lateral) < 0.1] = PAINT
        return mask

    def test_a_vehicle_hides_the_road_behind_it_and_nothing_else(self) -> None:
        before = self.mask()
        after = hide(before, self.VIEW, [self.box_from(0.5, 2.5, 20)])
        changed = (after != before).any(axis=1)
        assert set(np.unique(after[after != before])) == {HIDDEN}
        assert not changed[self.VIEW.distances < 19.5].any()
        assert changed[self.VIEW.distances > 20.5].all()
        assert (before == self.mask()).all(), "the mask that was given stays"

    def test_above_the_farthest_row_a_vehicle_hides_nothing(self) -> None:
        box = self.box_from(0.5, 2.5, 20)
        above = Box.sized(box.x1, 0, box.width, int(self.VIEW.outline[:, 1].min()) - 2)
        assert (hide(self.mask(), self.VIEW, [above]) == self.mask()).all()

    def test_rows_of_which_a_part_is_hidden_are_left_out(self) -> None:
        whole = np.full(len(self.VIEW.distances), 1.85)
        # from 20 m on, the box hides the inner half of the right line's paint
        half = hide(self.mask(), self.VIEW, [self.box_from(-0.5, 1.85, 20)])
        paint = paint_along(half, self.VIEW, whole, 0.2)
        assert paint.z.max() < 20.5
        assert paint.x == pytest.approx(1.85, abs=0.02)
        assert paint.visible == pytest.approx(len(paint.z) / len(whole))
        other = paint_along(half, self.VIEW, -whole, 0.2)
        assert len(other.z) == len(whole)
        assert other.visible == 1
