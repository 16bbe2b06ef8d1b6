import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.boxes import Box, coverage, iou_matrix, visible

SIDES = st.integers(1, 50)
PLACES = st.integers(-50, 50)
BOXES = st.tuples(PLACES, PLACES, SIDES, SIDES)


def boxes(
    *rows: tuple[float, float, float, float],
) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array(rows, np.float64).reshape(-1, 4)


def test_half_of_a_box_has_an_iou_of_a_half() -> None:
    assert iou_matrix(boxes((0, 0, 10, 10)), boxes((0, 0, 5, 10))) == pytest.approx(0.5)


def test_a_box_shifted_by_half_its_width_has_an_iou_of_a_third() -> None:
    # 50 in common of 100 + 100 - 50
    assert iou_matrix(boxes((0, 0, 10, 10)), boxes((5, 0, 10, 10))) == pytest.approx(1 / 3)


def test_boxes_that_touch_along_a_side_or_at_a_corner_do_not_overlap() -> None:
    a = boxes((0, 0, 10, 10))
    assert iou_matrix(a, boxes((10, 0, 10, 10), (0, 10, 5, 5), (10, 10, 3, 3))).max() == 0


def test_rows_are_the_first_boxes_and_columns_the_second() -> None:
    assert iou_matrix(boxes((0, 0, 1, 1), (9, 9, 1, 1)), boxes((9, 9, 1, 1))).tolist() == [[0], [1]]


def test_no_boxes_give_an_empty_matrix() -> None:
    assert iou_matrix(boxes(), boxes((0, 0, 1, 1))).shape == (0, 1)
    assert coverage(boxes((0, 0, 1, 1)), boxes()).shape == (1, 0)


def test_coverage_is_the_share_of_the_prediction_however_large_the_region() -> None:
    region = boxes((0, 0, 1000, 1000))
    assert coverage(boxes((10, 10, 5, 5), (995, 0, 10, 10)), region).tolist() == [[1], [0.5]]


@given(BOXES, BOXES)
def test_iou_is_that_of_single_boxes(
    a: tuple[int, int, int, int], b: tuple[int, int, int, int]
) -> None:
    assert iou_matrix(boxes(a), boxes(b)).item() == pytest.approx(Box(*a).iou(Box(*b)))


@given(BOXES, BOXES)
def test_coverage_is_never_less_than_iou(
    a: tuple[int, int, int, int], b: tuple[int, int, int, int]
) -> None:
    assert coverage(boxes(a), boxes(b)).item() >= iou_matrix(boxes(a), boxes(b)).item()


@given(x=st.floats(-200, 1100), y=st.floats(-200, 600), w=st.floats(1, 300), h=st.floats(1, 300))
def test_the_visible_part_lies_in_the_frame_and_in_the_box(
    x: float, y: float, w: float, h: float
) -> None:
    ((left, top, width, height),) = visible(boxes((x, y, w, h)), (900, 500))
    assert 0 <= left <= left + width <= 900
    assert 0 <= top <= top + height <= 500
    assert width <= w + 1e-9
    assert height <= h + 1e-9
