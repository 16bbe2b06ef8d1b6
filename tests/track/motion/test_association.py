"""Which tracks follow the same vehicle."""

import numpy as np
import pytest

from vdet.boxes import Float64Array
from vdet.config.schema import MotionTrackerSettings
from vdet.track.motion.tracker import take_over_ids, without_duplicates
from vdet.track.motion.vehicle import FrameStep, Observation, TrackedVehicle, whole_box

SIZE = (1000, 500)
BOX = np.array([400.0, 200.0, 500.0, 260.0])


def vehicle(
    box: Float64Array = BOX,
    *,
    number: int | None = None,
    score: float = 1.0,
    confirmed: bool = True,
    unseen: float = 0,
) -> TrackedVehicle:
    made = TrackedVehicle(
        Observation(box, score), FrameStep(-unseen, 0.04, SIZE), MotionTrackerSettings()
    )
    made.confirmed, made.id, made.unseen = confirmed, number, unseen
    return made


def moved(dx: float, dy: float = 0) -> Float64Array:
    return np.asarray(BOX + np.array([dx, dy, dx, dy]))


def test_one_of_which_only_a_part_was_seen_first_is_found_where_it_is_now() -> None:
    lost, new = vehicle(number=7, unseen=0.4), vehicle(np.array([470.0, 230.0, 500.0, 260.0]))
    take_over_ids([lost, new])
    assert new.id is None
    new.predict(0.04)
    new.see(Observation(BOX, 1.0), FrameStep(0.04, 0.04, SIZE))
    take_over_ids([lost, new])
    assert new.id == 7


@pytest.mark.parametrize(
    "new",
    [
        vehicle(moved(300)),
        vehicle(np.array([400.0, 200.0, 600.0, 320.0])),
        vehicle(confirmed=False),
        vehicle(unseen=0.04),
    ],
    ids=["too far", "too large", "unconfirmed", "not seen"],
)
def test_others_do_not(new: TrackedVehicle) -> None:
    lost = vehicle(number=7, unseen=1.2)
    assert take_over_ids([lost, new]) == [lost, new]
    assert new.id is None


def test_of_two_lost_vehicles_the_nearest_is_taken_and_only_by_one() -> None:
    lost = [vehicle(moved(-30), number=7, unseen=0.4), vehicle(moved(20), number=8, unseen=0.4)]
    new = [vehicle(), vehicle(moved(0, 40))]
    assert take_over_ids([*lost, *new]) == new
    assert [item.id for item in new] == [8, 7]


def boxes_of(*vehicles: TrackedVehicle) -> Float64Array:
    return whole_box(np.array([vehicle.state.mean[:, 0] for vehicle in vehicles]))


def without(*vehicles: TrackedVehicle) -> list[TrackedVehicle]:
    return without_duplicates(vehicles, boxes_of(*vehicles))


@pytest.mark.parametrize(("first", "second", "kept"), [(1, 2, 1), (2, 1, 1), (3, None, 3)])
def test_of_others_the_one_with_the_higher_score_stays_under_the_older_id(
    first: int, second: int | None, kept: int
) -> None:
    weaker, stronger = vehicle(number=first, score=0.6), vehicle(moved(10), number=second)
    assert without(weaker, stronger) == [stronger]
    assert stronger.id == kept


def test_of_two_tracks_that_were_apart_the_weaker_is_lost() -> None:
    """A vehicle that drives over a shadow is not lost, though the shadow was there before it."""
    shadow, car = vehicle(number=1, score=0.4), vehicle(moved(10), number=2)
    shadow.begin = shadow.since = -2.0
    car.begin = car.since = -1.0
    assert without(shadow, car) == [shadow, car]
    assert (shadow.is_present, car.is_present) == (False, True)


AROUND = np.array([430.0, 195.0, 590.0, 261.0])  # stands level with BOX, and covers most of it


def test_an_unconfirmed_track_with_a_higher_score_waits_beside_the_confirmed_one() -> None:
    weaker, unconfirmed = vehicle(number=1, score=0.6), vehicle(AROUND, confirmed=False)
    assert without(weaker, unconfirmed) == [weaker, unconfirmed]
    unconfirmed.confirmed = True
    assert without(weaker, unconfirmed) == [unconfirmed]
    assert unconfirmed.id == 1


@pytest.mark.parametrize(("score", "kept"), [(0.4, 2), (0.6, 1)], ids=["weak", "strong"])
def test_a_clear_vehicle_in_the_box_of_a_weak_one_is_not_a_part_of_it(
    score: float, kept: int
) -> None:
    both = vehicle(np.array([300.0, 150.0, 510.0, 300.0]), score=score)
    clear = vehicle(score=0.95, confirmed=False)
    boxes = boxes_of(both, clear)
    assert len(without_duplicates([both, clear], boxes)) == kept
