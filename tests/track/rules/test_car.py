import numpy as np
import pytest

from seed import SEED, tracker_but
from vdet.geometry import Box
from vdet.track.rules.car import Car
from vdet.track.rules.template import Image

BOX = Box(100, 60, 80, 60)
FRAME = np.random.default_rng(0).integers(0, 256, (240, 320, 3), dtype=np.uint8)


def seen(times: int = 1, needed: int = 10) -> Car:
    car = Car(needed=needed, history=10)
    for _ in range(times):
        car.see(BOX, (140, 90), FRAME)
    return car


def shifted(frame: Image, dx: int, dy: int) -> Image:
    return np.roll(frame, (dy, dx), axis=(0, 1))


def test_box_and_centroid_are_averages_over_the_last_ten_detections() -> None:
    car = seen()
    for i in range(10):
        car.see(Box(10 * i, 20 + i, 60 + 2 * i, 51), (10.0 * i, 5.0), FRAME)
    assert car.box == Box(45, 24, 69, 51)
    assert car.centroid == (45.0, 5.0)


def test_the_last_ten_images_are_kept_cut_from_their_frames() -> None:
    car = Car(needed=10, history=10)
    for x in range(12):
        car.see(Box(x, 0, 50, 60), (x, 0), FRAME)
    assert len(car.sightings) == 10
    for x, sighting in enumerate(car.sightings, start=2):
        np.testing.assert_array_equal(sighting.image, FRAME[0:60, x : x + 50])


def test_a_kept_image_does_not_change_with_the_frame_that_it_was_cut_from() -> None:
    frame = FRAME.copy()
    car = Car(needed=10, history=10)
    car.see(BOX, (140, 90), frame)
    frame[:] = 0
    np.testing.assert_array_equal(car.sightings[-1].image, FRAME[60:120, 100:180])


@pytest.mark.parametrize("history", [1, 3])
def test_the_history_setting_says_how_many_are_averaged(history: int) -> None:
    car = Car(needed=10, history=history)
    for x in (0, 30, 60, 90):
        car.see(Box(x, 0, 50, 50), (x, 0), FRAME)
    assert car.box.x == {1: 90, 3: 60}[history]


def test_detections_are_counted_in_a_row_and_in_all() -> None:
    car = seen(3)
    car.miss()
    assert (car.detected, car.in_a_row, car.detections, car.misses) == (False, 0, 3, 1)
    car.miss()
    assert car.misses == 2
    car.see(BOX, (140, 90), FRAME)
    assert (car.detected, car.in_a_row, car.detections, car.misses) == (True, 1, 4, 0)


def test_a_match_counts_as_a_detection_and_moves_the_centroid_with_the_box() -> None:
    car = seen()
    car.see_match(BOX.moved_to(106, 52), FRAME)
    assert car.sightings[-1].box == Box(106, 52, 80, 60)
    assert car.sightings[-1].centroid == (146, 82)
    assert (car.detected, car.detections, car.in_a_row, car.matches) == (True, 2, 2, 1)


def test_matches_in_a_row_are_ended_by_a_region_and_not_by_a_miss() -> None:
    car = seen()
    car.see_match(BOX, FRAME)
    car.miss()
    car.see_match(BOX, FRAME)
    assert car.matches == 2
    car.see(BOX, (140, 90), FRAME)
    assert car.matches == 0


def test_a_car_is_shown_when_detected_now_and_often_enough_in_a_row() -> None:
    assert not seen(9).is_shown
    car = seen(10)
    assert car.is_shown
    car.miss()
    assert not car.is_shown
    car.see(BOX, (140, 90), FRAME)
    assert not car.is_shown


def test_needing_fewer_detections_never_makes_it_more() -> None:
    car = seen(needed=10)
    car.need(3)
    assert car.needed == 3
    car.need(5)
    assert car.needed == 3


def test_a_car_vouched_for_counts_as_detected_that_often() -> None:
    car = seen()
    car.vouch(10)
    assert car.is_shown
    assert (car.in_a_row, car.detections) == (10, 10)


def test_vouching_takes_no_detections_away() -> None:
    car = seen(12)
    car.vouch(10)
    assert (car.in_a_row, car.detections) == (12, 12)


def test_the_latest_image_is_looked_for_around_the_latest_box() -> None:
    car = Car(needed=10, history=10)
    car.see(Box(0, 0, 60, 60), (30, 30), FRAME)
    car.see(BOX, (140, 90), FRAME)
    assert car.find_in(shifted(FRAME, 7, -4), SEED.tracker) == BOX.moved_to(107, 56)


def test_the_settings_limit_the_search() -> None:
    moved = shifted(FRAME, 30, 0)
    assert seen().find_in(moved, tracker_but(match_distance=30)) == BOX.moved_to(130, 60)
    assert seen().find_in(moved, tracker_but(match_distance=29)) is None


def test_two_cars_alike_are_two_cars() -> None:
    assert len({seen(), seen()}) == 2
