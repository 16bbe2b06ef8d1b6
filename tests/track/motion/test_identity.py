import numpy as np
import pytest

from vdet.config.schema import MotionSettings
from vdet.geometry import Float64Array
from vdet.track.motion.identity import take_over_ids, without_duplicates
from vdet.track.motion.state import MotionState
from vdet.track.motion.vehicle import Vehicle

SETTINGS = MotionSettings()
SIZE = (1000, 500)
BOX = np.array([400.0, 200.0, 100.0, 60.0])


def vehicle(
    box: Float64Array = BOX,
    *,
    number: int | None = None,
    evidence: float = SETTINGS.needed,
    confirmed: bool = True,
    misses: int = 0,
) -> Vehicle:
    state = MotionState.at_rest(box, 0.1, 0.1)
    return Vehicle(state, evidence, confirmed, number, misses)


def moved(dx: float, dy: float = 0) -> Float64Array:
    return np.asarray(BOX + np.array([dx, dy, 0, 0]))


def test_a_newly_confirmed_vehicle_near_a_lost_one_takes_its_id() -> None:
    lost, new = vehicle(number=7, misses=30), vehicle(moved(110))
    assert take_over_ids([lost, new]) == [new]
    assert new.id == 7


@pytest.mark.parametrize(
    "new",
    [vehicle(moved(300)), vehicle(BOX * [1, 1, 2, 2]), vehicle(confirmed=False), vehicle(misses=1)],
    ids=["too far", "too large", "unconfirmed", "not seen"],
)
def test_others_do_not(new: Vehicle) -> None:
    lost = vehicle(number=7, misses=30)
    assert take_over_ids([lost, new]) == [lost, new]
    assert new.id is None


def test_a_vehicle_that_is_seen_keeps_its_id() -> None:
    both = [vehicle(number=7), vehicle(moved(110))]
    assert take_over_ids(both) == both
    assert both[1].id is None


def test_of_two_lost_vehicles_the_nearest_is_taken_and_only_by_one() -> None:
    lost = [vehicle(moved(-60), number=7, misses=9), vehicle(moved(20), number=8, misses=9)]
    new = [vehicle(), vehicle(moved(0, 60))]
    assert take_over_ids([*lost, *new]) == new
    assert [each.id for each in new] == [8, 7]


def without(*vehicles: Vehicle) -> list[Vehicle]:
    return without_duplicates(vehicles, SIZE, SETTINGS)


def test_of_two_equally_sure_tracks_of_one_vehicle_the_older_stays() -> None:
    older, younger = vehicle(number=1), vehicle(moved(10), number=2)
    assert without(older, younger) == [older]


def test_of_others_the_surer_stays() -> None:
    older, younger = vehicle(number=1, evidence=0.5), vehicle(moved(10), number=2)
    assert without(older, younger) == [younger]


def test_an_unconfirmed_track_never_pushes_a_confirmed_one_out() -> None:
    older, younger = vehicle(number=1, evidence=0.0), vehicle(moved(10), confirmed=False)
    assert without(younger, older) == [older]


PART = np.array([420.0, 205.0, 50.0, 30.0])


def test_a_new_track_inside_a_vehicle_is_a_part_of_it_and_a_shown_one_is_not() -> None:
    whole = vehicle(number=1)
    assert without(whole, vehicle(PART, confirmed=False)) == [whole]
    assert len(without(whole, vehicle(PART, number=2))) == 2


@pytest.mark.parametrize(("first", "second"), [(0, 3), (3, 0)])
def test_a_vehicle_that_is_not_seen_is_no_duplicate(first: int, second: int) -> None:
    both = [vehicle(number=1, misses=first), vehicle(number=2, misses=second)]
    assert without(*both) == both
