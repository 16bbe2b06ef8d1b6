import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.boxes import Box, are_nested

boxes = st.builds(
    Box,
    st.integers(-50, 50),
    st.integers(-50, 50),
    st.integers(0, 60),
    st.integers(0, 60),
)


def pixels(box: Box) -> set[tuple[int, int]]:
    return {(x, y) for x in range(box.x, box.right) for y in range(box.y, box.bottom)}


def test_right_and_bottom_are_the_first_pixels_beyond_the_box() -> None:
    box = Box(10, 20, 30, 40)
    assert (box.right, box.bottom) == (40, 60)


def test_the_center_of_a_single_pixel_is_half_a_pixel_in() -> None:
    assert Box(3, 4, 1, 1).center == (3.5, 4.5)


@pytest.mark.parametrize(
    ("point", "inside"),
    [
        ((10, 20), True),
        ((39.9, 59.9), True),
        ((40, 30), False),
        ((20, 60), False),
        ((9, 30), False),
    ],
)
def test_near_sides_belong_to_the_box_and_far_sides_do_not(
    point: tuple[float, float], inside: bool
) -> None:
    assert Box(10, 20, 30, 40).contains(point) is inside


def test_a_box_of_negative_size_has_no_area() -> None:
    assert Box(0, 0, -3, -4).area == 0


def test_a_moved_box_keeps_its_size() -> None:
    assert Box(1, 2, 3, 4).moved_to(-5, 6) == Box(-5, 6, 3, 4)


@given(boxes, boxes)
def test_the_intersection_covers_exactly_the_common_pixels(one: Box, other: Box) -> None:
    assert pixels(one.intersection(other)) == pixels(one) & pixels(other)


@given(boxes, boxes)
def test_the_union_is_the_smallest_box_over_both(one: Box, other: Box) -> None:
    union = one.union(other)
    assert pixels(union) >= pixels(one) | pixels(other)
    assert {union.x, union.right} <= {one.x, other.x, one.right, other.right}
    assert {union.y, union.bottom} <= {one.y, other.y, one.bottom, other.bottom}


@given(boxes, boxes)
def test_iou_is_the_share_of_common_pixels(one: Box, other: Box) -> None:
    total = pixels(one) | pixels(other)
    expected = len(pixels(one) & pixels(other)) / len(total) if total else 0
    assert one.iou(other) == pytest.approx(expected)
    assert one.iou(other) == other.iou(one)


@given(boxes)
def test_a_clipped_box_lies_in_the_image(box: Box) -> None:
    frame = pixels(Box(0, 0, 40, 30))
    assert pixels(box.clipped(40, 30)) == pixels(box) & frame


@pytest.mark.parametrize(
    ("other", "gap"),
    [
        (Box(10, 0, 5, 10), 0),
        (Box(5, 5, 5, 5), 0),
        (Box(17, 0, 5, 10), 7),
        (Box(0, -9, 10, 5), 4),
        (Box(13, 14, 5, 5), 5),
        (Box(-8, -16, 5, 12), 5),
    ],
)
def test_gap_is_the_distance_between_outlines(other: Box, gap: float) -> None:
    assert Box(0, 0, 10, 10).gap(other) == gap
    assert other.gap(Box(0, 0, 10, 10)) == gap


def test_a_diagonal_gap_is_euclidean() -> None:
    assert Box(0, 0, 1, 1).gap(Box(2, 2, 1, 1)) == pytest.approx(math.sqrt(2))


WHOLE, INSIDE, BESIDE = (100, 100, 80, 60), (110, 110, 40, 30), (150, 100, 80, 60)


@pytest.mark.parametrize(
    ("scores", "nested"),
    [((0.9, 0.8), [False, True]), ((0.5, 0.5), [False, True]), ((0.8, 0.9), [True, False])],
)
def test_of_two_boxes_in_one_another_the_one_with_the_lower_score_is_nested(
    scores: tuple[float, float], nested: list[bool]
) -> None:
    boxes = np.array([WHOLE, INSIDE], np.float64)
    assert are_nested(boxes, scores).tolist() == nested
    assert are_nested(boxes[::-1], scores[::-1]).tolist() == nested[::-1]


def test_boxes_that_only_overlap_are_not_nested() -> None:
    assert are_nested(np.array([WHOLE, BESIDE], np.float64), (1, 2)).tolist() == [False, False]
    assert are_nested(np.zeros((0, 4)), []).tolist() == []
