"""Which detection belongs to which vehicle, and which vehicles are the same one."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vdet.boxes import Float64Array, iou_matrix
from vdet.config.schema import MotionTrackerSettings
from vdet.track.motion.association import (
    WIDEST_BUFFER,
    buffered_iou,
    pair,
    take_over_ids,
    without_duplicates,
)
from vdet.track.motion.vehicle import Observation, Vehicle

# How well boxes fit

EXPECTED = np.array([[100.0, 100, 200, 160], [400, 100, 450, 150]])
BESIDE = np.array([[210.0, 100, 310, 160]])


def buffers(x: float, y: float) -> Float64Array:
    return np.tile([x, y], (2, 1)).astype(np.float64)


def test_without_a_buffer_it_is_the_intersection_over_union() -> None:
    found = np.array([[120.0, 110, 220, 170], [410, 100, 460, 160]])
    fit = buffered_iou(EXPECTED, buffers(0, 0), found)
    assert fit == pytest.approx(iou_matrix(EXPECTED, found))


def test_boxes_that_do_not_touch_fit_where_the_motion_is_unknown() -> None:
    assert buffered_iou(EXPECTED, buffers(0.05, 0.05), BESIDE)[0, 0] == 0
    assert buffered_iou(EXPECTED, buffers(0.5, 0.1), BESIDE)[0, 0] == pytest.approx(90 / 310)


def test_the_nearer_of_two_boxes_fits_better() -> None:
    found = np.array([[140.0, 100, 240, 160], [180, 100, 280, 160]])
    nearer, farther = buffered_iou(EXPECTED, buffers(0.5, 0.5), found)[0]
    assert nearer > farther > 0


def test_a_buffer_has_a_limit() -> None:
    widest = buffered_iou(EXPECTED, buffers(WIDEST_BUFFER, WIDEST_BUFFER), BESIDE)
    assert (buffered_iou(EXPECTED, buffers(9, 9), BESIDE) == widest).all()


def test_no_boxes_give_an_empty_matrix() -> None:
    none = np.zeros((0, 4))
    assert buffered_iou(none, np.zeros((0, 2)), BESIDE).shape == (0, 1)
    assert buffered_iou(EXPECTED, buffers(0, 0), none).shape == (2, 0)


# Pairs


def matrix(*rows: list[float]) -> Float64Array:
    return np.array(rows, np.float64)


def test_the_pairs_add_up_to_most_even_if_one_is_not_its_best() -> None:
    assert pair(matrix([0.6, 0.5], [0.5, 0.0]), [[0, 1]]) == {0: 1, 1: 0}


def test_nothing_is_paired_at_value_0() -> None:
    assert pair(matrix([0.6, 0.0], [0.5, 0.0]), [[0, 1]]) == {0: 0}
    assert pair(matrix([0.0]), [[0]]) == {}


def test_a_later_round_has_what_the_earlier_ones_left() -> None:
    values = matrix([0.9, 0.4], [0.3, 0.0])
    assert pair(values, [[1], [0]]) == {1: 0, 0: 1}


def test_rows_of_no_round_are_not_paired() -> None:
    assert pair(matrix([0.9], [0.4]), [[1]]) == {1: 0}


def test_no_vehicles_or_no_detections_give_no_pairs() -> None:
    assert pair(np.zeros((0, 3)), [[], []]) == {}
    assert pair(np.zeros((2, 0)), [[0], [1]]) == {}


def test_the_values_are_left_as_they_are() -> None:
    values = matrix([0.6, 0.5], [0.5, 0.0])
    pair(values, [[0], [1]])
    assert (values == matrix([0.6, 0.5], [0.5, 0.0])).all()


worths = st.sampled_from([0.0, 0.0, 0.3, 0.45, 0.7, 1.0])


@given(arrays(np.float64, (3, 4), elements=worths))
def test_no_other_pairs_add_up_to_more(values: Float64Array) -> None:
    pairs = pair(values, [[0, 1, 2]])
    assert len(set(pairs.values())) == len(pairs)
    best = max(values[range(3), list(columns)].sum() for columns in permutations(range(4), 3))
    total = sum(values[row, column] for row, column in pairs.items())
    assert np.isclose(total, best)


# Vehicles that are the same one

SIZE = (1000, 500)
BOX = np.array([400.0, 200.0, 500.0, 260.0])


def vehicle(
    box: Float64Array = BOX,
    *,
    number: int | None = None,
    score: float = 1.0,
    confirmed: bool = True,
    unseen: float = 0,
) -> Vehicle:
    made = Vehicle.new(Observation(box, score), 0.04, MotionTrackerSettings())
    made.confirmed, made.id, made.unseen = confirmed, number, unseen
    return made


def moved(dx: float, dy: float = 0) -> Float64Array:
    return np.asarray(BOX + np.array([dx, dy, dx, dy]))


def test_a_newly_confirmed_vehicle_near_a_lost_one_takes_its_id() -> None:
    lost, new = vehicle(number=7, unseen=1.2), vehicle(moved(110))
    assert take_over_ids([lost, new]) == [new]
    assert new.id == 7


@pytest.mark.parametrize(
    "new",
    [
        vehicle(moved(300)),
        vehicle(BOX * [1, 1, 2, 2]),
        vehicle(confirmed=False),
        vehicle(unseen=0.04),
    ],
    ids=["too far", "too large", "unconfirmed", "not seen"],
)
def test_others_do_not(new: Vehicle) -> None:
    lost = vehicle(number=7, unseen=1.2)
    assert take_over_ids([lost, new]) == [lost, new]
    assert new.id is None


def test_a_vehicle_that_is_seen_keeps_its_id() -> None:
    both = [vehicle(number=7), vehicle(moved(110))]
    assert take_over_ids(both) == both
    assert both[1].id is None


def test_of_two_lost_vehicles_the_nearest_is_taken_and_only_by_one() -> None:
    lost = [vehicle(moved(-60), number=7, unseen=0.4), vehicle(moved(20), number=8, unseen=0.4)]
    new = [vehicle(), vehicle(moved(0, 60))]
    assert take_over_ids([*lost, *new]) == new
    assert [each.id for each in new] == [8, 7]


def without(*vehicles: Vehicle) -> list[Vehicle]:
    return without_duplicates(vehicles, SIZE)


def test_of_two_tracks_with_equal_scores_the_older_one_stays() -> None:
    older, younger = vehicle(number=1), vehicle(moved(10), number=2)
    assert without(older, younger) == [older]
    assert older.id == 1


@pytest.mark.parametrize(("first", "second", "kept"), [(1, 2, 1), (2, 1, 1), (3, None, 3)])
def test_of_others_the_one_with_the_higher_score_stays_under_the_older_id(
    first: int, second: int | None, kept: int
) -> None:
    weaker, stronger = vehicle(number=first, score=0.6), vehicle(moved(10), number=second)
    assert without(weaker, stronger) == [stronger]
    assert stronger.id == kept


AROUND = np.array([430.0, 195.0, 590.0, 261.0])  # stands level with BOX, and covers most of it


def test_an_unconfirmed_track_with_a_higher_score_waits_beside_the_confirmed_one() -> None:
    weaker, unconfirmed = vehicle(number=1, score=0.6), vehicle(AROUND, confirmed=False)
    assert without(weaker, unconfirmed) == [weaker, unconfirmed]
    unconfirmed.confirmed = True
    assert without(weaker, unconfirmed) == [unconfirmed]
    assert unconfirmed.id == 1


def test_an_unconfirmed_track_with_a_lower_score_is_dropped() -> None:
    stronger, unconfirmed = vehicle(number=1), vehicle(AROUND, score=0.6, confirmed=False)
    assert without(unconfirmed, stronger) == [stronger]


PART = np.array([420.0, 205.0, 470.0, 235.0])


def test_a_new_track_inside_a_vehicle_is_a_part_of_it_and_a_shown_one_is_not() -> None:
    whole = vehicle(number=1)
    assert without(whole, vehicle(PART, confirmed=False)) == [whole]
    assert len(without(whole, vehicle(PART, number=2))) == 2


@pytest.mark.parametrize(("first", "second"), [(0, 0.1), (0.1, 0)])
def test_a_vehicle_that_is_not_seen_is_no_duplicate(first: float, second: float) -> None:
    both = [vehicle(number=1, unseen=first), vehicle(number=2, unseen=second)]
    assert without(*both) == both
