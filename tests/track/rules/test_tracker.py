"""Rules 1 and 12 to 17, and ids, through the tracker; rules 2 to 11 are in test_association."""

import numpy as np
import pytest

from boxing import moved_to
from seed import SEED_TRACKER, tracker_but
from textured_road import textured_road
from track.rules.scenes import detections
from vdet.boxes import Box, Boxes, Image
from vdet.media import Picture
from vdet.track.rules import Region, RulesTracker, large_enough
from vdet.track.track import Track

SEDAN, VAN = Box.sized(100, 200, 100, 80), Box.sized(400, 200, 120, 100)
GREY = np.full((360, 640, 3), 90, np.uint8)


def road(*boxes: Box | None) -> Image:
    return textured_road(640, 360, *boxes)


def update(cars: RulesTracker, image: Image, *boxes: Box, peak: float = 2.0) -> list[Track]:
    return cars.update(detections(boxes, peak), 0.0, Picture(image))


def see(cars: RulesTracker, *boxes: Box, frames: int = 1, peak: float = 2.0) -> list[list[Track]]:
    """Give the tracker regions at `boxes` of a grey picture, in which nothing matches."""
    return [update(cars, GREY, *boxes, peak=peak) for _ in range(frames)]


def show(cars: RulesTracker, box: Box, times: int = 10) -> None:
    """Make the first car known, with its texture, until it is shown."""
    for _ in range(times):
        tracks = update(cars, road(box), box)
    assert [track.box for track in tracks] == [box]


def ids(tracks: list[Track]) -> list[int]:
    return [track.id for track in tracks]


# Rule 1
def test_regions_that_are_too_small_are_ignored() -> None:
    settings = tracker_but(detections_needed=1)
    narrow, flat = Box.sized(100, 200, 49, 80), Box.sized(300, 200, 80, 49)
    assert see(RulesTracker(settings), narrow, flat) == [[]]
    assert len(see(RulesTracker(settings), Box.sized(100, 200, 50, 50))[0]) == 1


def test_a_region_has_the_strength_of_its_detection_as_its_peak() -> None:
    found = Boxes([[10, 20, 90.4, 99.6]], [0.5], data={"centroid": [[44, 55]], "strength": [3.5]})
    (region,) = large_enough(found, 640, 360, SEED_TRACKER)
    assert region == Region(Box.sized(10, 20, 80, 80), (44, 55), 3.5, 0.5)


# Rule 12
BUS = Box.sized(230, 200, 120, 100)
BOTH = Box.sized(90, 190, 270, 120)


def test_a_shown_car_left_inside_another_is_absorbed_which_is_shown_at_once() -> None:
    cars = RulesTracker(tracker_but(history=1))  # so that a car's rectangle is its latest one
    show(cars, SEDAN)
    for _ in range(2):
        update(cars, road(SEDAN, BUS), SEDAN, BUS)
    (track,) = update(cars, road(None, BUS), BOTH)  # only the bus is to be seen
    assert track.box == BOTH


# Rule 13
def test_a_shown_car_without_a_region_is_found_by_its_image() -> None:
    cars = RulesTracker(tracker_but(history=1))
    show(cars, SEDAN)
    moved = moved_to(SEDAN, 130, 240)
    assert update(cars, road(moved)) == [Track(1, moved, 1.0, state="predicted")]
    assert update(cars, road(moved), moved) == [Track(1, moved, 1.0, state="detected")]


def test_a_car_that_was_never_shown_is_not_searched() -> None:
    cars = RulesTracker(SEED_TRACKER)
    for _ in range(8):
        update(cars, road(SEDAN), SEDAN)
    assert update(cars, road(SEDAN)) == []
    assert update(cars, road(SEDAN), SEDAN) == []


# Rule 14
@pytest.mark.parametrize(("peak", "first_shown"), [(2.0, 10), (5.0, 3)])
def test_a_car_is_shown_after_ten_detections_in_a_row_or_three_confident_ones(
    peak: float, first_shown: int
) -> None:
    shown = see(RulesTracker(SEED_TRACKER), SEDAN, frames=12, peak=peak)
    assert [bool(tracks) for tracks in shown].index(True) == first_shown - 1
    assert all(shown[first_shown - 1 :])


def test_a_missed_car_is_not_shown_and_counted_from_the_start_again() -> None:
    cars = RulesTracker(SEED_TRACKER)
    show(cars, SEDAN)
    assert see(cars) == [[]]
    shown = see(cars, SEDAN, frames=10)
    assert shown[:9] == [[]] * 9
    assert ids(shown[9]) == [1]


# Rules 15 to 17. A car that comes back under its old id was not deleted.
@pytest.mark.parametrize(
    ("detections", "young", "id_after"), [(6, 7, 2), (7, 7, 1), (7, 8, 2), (1, 0, 1)]
)
def test_a_car_with_fewer_detections_than_seven_is_deleted_at_its_first_miss(
    detections: int, young: int, id_after: int
) -> None:
    cars = RulesTracker(tracker_but(detections_to_keep=young, detections_needed=1))
    see(cars, SEDAN, frames=detections)
    see(cars)
    assert ids(see(cars, SEDAN)[0]) == [id_after]


@pytest.mark.parametrize("max_matches", [12, 4])
def test_a_car_whose_last_detections_all_were_matches_is_deleted(max_matches: int) -> None:
    cars = RulesTracker(tracker_but(max_matches=max_matches))
    show(cars, SEDAN)
    matched = [update(cars, road(SEDAN)) for _ in range(max_matches)]
    assert [ids(tracks) for tracks in matched] == [[1]] * (max_matches - 1) + [[]]
    assert see(cars, SEDAN, frames=9) == [[]] * 9
    assert ids(see(cars, SEDAN)[0]) == [2]


@pytest.mark.parametrize(
    ("misses", "max_misses", "id_after"), [(4, 5, 1), (5, 5, 2), (2, 2, 2), (1, 2, 1)]
)
def test_a_car_missed_five_frames_in_a_row_is_deleted(
    misses: int, max_misses: int, id_after: int
) -> None:
    cars = RulesTracker(tracker_but(max_misses=max_misses, detections_needed=1))
    see(cars, SEDAN, frames=7)
    assert see(cars, frames=misses) == [[]] * misses
    assert ids(see(cars, SEDAN)[0]) == [id_after]


def test_ids_follow_the_order_in_which_cars_are_first_shown() -> None:
    cars = RulesTracker(SEED_TRACKER)
    see(cars, SEDAN, frames=5)
    see(cars, SEDAN, VAN, frames=5)
    shown = see(cars, VAN, SEDAN, frames=5)
    assert [(track.id, track.box) for track in shown[-1]] == [(1, SEDAN), (2, VAN)]


def test_the_score_of_a_track_is_the_average_of_its_last_ten_detections() -> None:
    cars = RulesTracker(SEED_TRACKER)
    shown = [
        cars.update(detections([SEDAN], score=0.05 * n), 0.0, Picture(GREY)) for n in range(12)
    ]
    assert [track.score for track in shown[-1]] == pytest.approx([0.05 * 6.5])
