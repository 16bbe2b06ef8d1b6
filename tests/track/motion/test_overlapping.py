import numpy as np
import pytest

from vdet.boxes import Float64Array
from vdet.track.motion.overlapping import (
    are_hidden,
    are_parts,
    is_part,
    is_same,
    shows_both,
    stretched,
)


def box(x: float, y: float, width: float, height: float) -> Float64Array:
    return np.array([x, y, x + width, y + height], np.float64)


def boxes(*each: Float64Array) -> Float64Array:
    return np.stack(each)


FAR, NEAR = box(100, 100, 80, 50), box(130, 100, 150, 100)
BOTH_THERE = np.array([True, True])


def test_the_nearer_vehicle_hides_the_farther_one_and_not_the_other_way_round() -> None:
    assert are_hidden(boxes(FAR, NEAR), BOTH_THERE, 0.5) == [True, False]


def test_a_vehicle_before_a_larger_one_is_not_hidden_by_it() -> None:
    truck, car = box(100, 100, 300, 200), box(150, 250, 110, 90)
    assert are_hidden(boxes(truck, car), BOTH_THERE, 0.5) == [False, False]


def test_hidden_is_what_is_covered_for_more_than_the_share() -> None:
    assert are_hidden(boxes(FAR, NEAR), BOTH_THERE, 0.63) == [False, False]


def test_a_vehicle_that_is_not_there_hides_nothing() -> None:
    assert are_hidden(boxes(FAR, NEAR), np.array([True, False]), 0.5) == [False, False]


def test_without_vehicles_none_is_hidden() -> None:
    assert are_hidden(np.zeros((0, 4)), np.zeros(0, bool), 0.5) == []


@pytest.mark.parametrize(
    ("other", "same"),
    [
        (box(40, 0, 100, 60), True),  # level and overlapping
        (box(80, 0, 100, 60), False),  # level, hardly overlapping
        (box(40, -20, 100, 60), False),  # overlapping, not level
        (box(10, 12, 100, 60), True),  # nearly the same box
        (box(200, 0, 100, 60), False),
    ],
)
def test_boxes_are_of_one_vehicle_where_they_are_alike_or_overlap_and_stand_level(
    other: Float64Array, same: bool
) -> None:
    one = box(0, 0, 100, 60)
    assert is_same(one, boxes(other)) is same
    assert is_same(other, boxes(one)) is same


def test_one_of_several_is_enough_and_none_is_not() -> None:
    one = box(0, 0, 100, 60)
    assert is_same(one, boxes(box(500, 0, 9, 9), one))
    assert not is_same(one, np.zeros((0, 4)))


def test_a_part_lies_in_the_other_box_for_more_than_the_share() -> None:
    assert is_part(box(0, 0, 20, 20), boxes(box(8, 0, 100, 60)), 0.59)
    assert not is_part(box(0, 0, 20, 20), boxes(box(8, 0, 100, 60)), 0.6)


def test_a_part_lies_in_a_box_that_scores_higher_for_more_than_the_share() -> None:
    found = boxes(box(0, 0, 20, 20), box(8, 0, 100, 60))
    assert are_parts(found, np.array([0.3, 0.9]), 0.59).tolist() == [True, False]
    assert are_parts(found, np.array([0.3, 0.9]), 0.6).tolist() == [False, False]
    assert are_parts(found, np.array([0.9, 0.3]), 0.59).tolist() == [False, False]


def test_a_box_with_nearly_the_score_of_the_one_before_it_is_no_part() -> None:
    found = boxes(box(0, 0, 20, 20), box(8, 0, 100, 60))
    assert are_parts(found, np.array([0.65, 0.8]), 0.5).tolist() == [False, False]


LEFT, RIGHT = box(100, 100, 80, 50), box(170, 100, 80, 70)


@pytest.mark.parametrize(
    ("found", "both"),
    [(box(100, 100, 150, 70), True), (box(98, 99, 84, 53), False), (box(120, 100, 60, 50), False)],
    ids=["around both", "the first", "between"],
)
def test_a_region_shows_both_where_it_fits_them_better_than_one(
    found: Float64Array, both: bool
) -> None:
    assert shows_both(found, boxes(LEFT, RIGHT), 0.6) is both


def test_a_box_is_stretched_with_the_one_around_it() -> None:
    before, after = box(100, 100, 150, 70), box(200, 100, 300, 35)
    assert stretched(before, before, after) == pytest.approx(after)
    assert stretched(RIGHT, before, after) == pytest.approx(box(340, 100, 160, 35))
