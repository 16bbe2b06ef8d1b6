"""Finding the paint of both lines in a mask."""

import numpy as np
import pytest

from vdet.config.lanes import LaneSettings
from vdet.geometry import Float64Array
from vdet.lanes.curves import Curves
from vdet.lanes.search import find_base, paint_along, slide_windows
from vdet.lanes.view import View
from vdet.media.images import Image

SETTINGS = LaneSettings()


@pytest.fixture
def view() -> View:
    return View(SETTINGS.view, 1280, 720)


def drawn(view: View, *lines: Float64Array, rows: slice = slice(None)) -> Image:
    """Draw lines, given by x at each row, five columns wide."""
    mask = np.zeros((len(view.distances), len(view.laterals)), np.uint8)
    for line in lines:
        columns = np.rint(view.columns(line)).astype(int)
        for row in range(len(mask))[rows]:
            mask[row, max(0, columns[row] - 2) : columns[row] + 3] = 255
    return mask


def constant(view: View, *laterals: float) -> list[Float64Array]:
    return [np.full(len(view.distances), lateral) for lateral in laterals]


def test_the_base_is_where_both_lines_begin(view: View) -> None:
    mask = drawn(view, *constant(view, -1.6, 2.0))
    assert find_base(mask, view, SETTINGS) == pytest.approx((-1.6, 2.0), abs=0.05)


def test_of_many_lines_the_pair_about_the_camera_is_taken(view: View) -> None:
    mask = drawn(view, *constant(view, -3.9, -0.4, 3.3))
    assert find_base(mask, view, SETTINGS) == pytest.approx((-0.4, 3.3), abs=0.05)


def test_lines_too_close_together_are_no_lane(view: View) -> None:
    assert find_base(drawn(view, *constant(view, -1.0, 1.0)), view, SETTINGS) is None


def test_an_empty_mask_has_no_base(view: View) -> None:
    assert find_base(drawn(view), view, SETTINGS) is None


def test_a_view_no_wider_than_a_lane_does_no_harm() -> None:
    narrow = SETTINGS.view.model_copy(update={"margin": 0.0})
    view = View(narrow, 1280, 720)
    mask = np.full((len(view.distances), len(view.laterals)), 255, np.uint8)
    base = find_base(mask, view, SETTINGS)
    assert base is not None
    assert base[1] - base[0] == pytest.approx(3.4, abs=0.4)


def test_windows_slide_along_a_bend(view: View) -> None:
    lines = Curves(bend=1 / 500, heading=-0.02, left=-1.85, right=1.85, pitch=0).at(view.distances)
    base = float(lines[0][-1]), float(lines[1][-1])
    guide = slide_windows(drawn(view, *lines), view, base, SETTINGS)
    for found, line in zip(guide, lines, strict=True):
        assert np.abs(found - line).max() < SETTINGS.search.margin


def test_a_window_without_paint_moves_as_the_other_line_s_does(view: View) -> None:
    left, right = Curves(1 / 500, 0, -1.85, 1.85, 0).at(view.distances)
    mask = drawn(view, left) | drawn(view, right, rows=slice(-40, None))
    guide = slide_windows(mask, view, (float(left[-1]), float(right[-1])), SETTINGS)
    assert np.abs(guide[1] - right).max() < SETTINGS.search.margin


def test_paint_is_given_by_the_middle_of_each_row(view: View) -> None:
    line = np.linspace(1.0, 2.0, len(view.distances))
    paint = paint_along(drawn(view, line), view, line + 0.1, margin=0.3)
    assert (paint.z == view.distances).all()
    assert np.abs(paint.x - line).max() < 0.02


def test_rows_without_paint_are_left_out(view: View) -> None:
    line = constant(view, 1.0)[0]
    paint = paint_along(drawn(view, line, rows=slice(10, 30)), view, line, margin=0.3)
    assert (paint.z == view.distances[10:30]).all()


def test_paint_beyond_the_margin_is_left_out(view: View) -> None:
    mask = drawn(view, *constant(view, 1.0))
    assert len(paint_along(mask, view, constant(view, 1.5)[0], margin=0.3).z) == 0


@pytest.mark.parametrize("lateral", [-4.8, 4.8, -20.0, 20.0])
def test_a_guide_that_leaves_the_picture_does_no_harm(view: View, lateral: float) -> None:
    mask = np.full((len(view.distances), len(view.laterals)), 255, np.uint8)
    paint = paint_along(mask, view, constant(view, lateral)[0], margin=0.3)
    assert ((paint.x >= view.laterals[0]) & (paint.x <= view.laterals[-1])).all()
