"""Rules 2 to 11, each on a scene of textured rectangles; the n-th has always the same texture."""

import pytest

from boxing import moved_to
from seed import SEED_TRACKER
from textured_road import textured_road
from vdet.boxes import Box, Image
from vdet.track.rules import Car, Region, RulesTracker

LEFT, RIGHT = Box.sized(100, 200, 100, 80), Box.sized(320, 200, 100, 80)


def road(*boxes: Box | None) -> Image:
    return textured_road(900, 480, *boxes)


def a_car(box: Box, frame: Image, shown_as: int | None = None) -> Car:
    car = Car(SEED_TRACKER, shown_as)
    car.see(region(box), frame)
    return car


def region(box: Box, peak: float = 2.0) -> Region:
    return Region(box, box.center, peak)


def associate(
    cars: list[Car], boxes: list[Box], frame: Image | None = None, peak: float = 2.0
) -> RulesTracker:
    tracker = RulesTracker(SEED_TRACKER)
    tracker.cars = list(cars)
    tracker.associate([region(box, peak) for box in boxes], road() if frame is None else frame)
    return tracker


def boxes_of(tracker: RulesTracker) -> dict[Car, Box]:
    return {car: place.box for car, place in tracker.assigned.items()}


# Rule 2
def test_a_region_belongs_to_the_car_whose_centroid_it_contains() -> None:
    cars = [a_car(LEFT, road()), a_car(RIGHT, road())]
    over_right, over_left = Box.sized(310, 190, 100, 80), Box.sized(90, 190, 100, 80)
    result = associate(cars, [over_right, over_left])
    assert boxes_of(result) == {cars[1]: over_right, cars[0]: over_left}
    assert result.cars == cars


# Rule 3
AROUND_BOTH = Box.sized(90, 190, 340, 100)


def two_cars(*shown_as: int | None) -> list[Car]:
    frame = road(LEFT, RIGHT)
    ids = shown_as or (None, None)
    return [a_car(LEFT, frame, ids[0]), a_car(RIGHT, frame, ids[1])]


def test_a_region_of_several_cars_with_one_confirmed_is_that_cars() -> None:
    cars = two_cars()
    result = associate(cars, [AROUND_BOTH], road(None, RIGHT))
    assert boxes_of(result) == {cars[1]: AROUND_BOTH}
    assert result.cars == cars


def test_a_region_of_several_cars_with_none_confirmed_is_the_nearest_ones() -> None:
    cars = two_cars()
    nearer_to_right = Box.sized(140, 190, 340, 100)
    result = associate(cars, [nearer_to_right], road())
    assert boxes_of(result) == {cars[1]: nearer_to_right}


# Rules 4 and 5
CLOSE = Box.sized(150, 200, 100, 80)


def overlapping_cars(*shown_as: int | None) -> tuple[list[Car], Image]:
    """Two cars, the second 50 pixels further right and hiding half of the first."""
    frame = road(LEFT, CLOSE)
    return [a_car(LEFT, frame, shown_as[0]), a_car(CLOSE, frame, shown_as[1])], frame


@pytest.mark.parametrize(
    ("shown_as", "kept"), [((7, 4), 4), ((None, 4), 4), ((7, None), 7), ((None, None), None)]
)
def test_confirmed_cars_that_overlap_become_one_shown_at_once_under_the_lowest_id(
    shown_as: tuple[int | None, int | None], kept: int | None
) -> None:
    cars, frame = overlapping_cars(*shown_as)
    around = Box.sized(95, 195, 160, 90)
    result = associate(cars, [around], frame)
    (car,) = result.cars
    assert car not in cars
    assert car.id == kept
    assert boxes_of(result) == {car: around}
    car.see(result.assigned[car], frame)
    assert (car.is_shown, car.box) == (True, around)


def test_confirmed_cars_apart_stay_apart_and_move_to_their_matches() -> None:
    cars = two_cars(3, 5)
    left, right = moved_to(LEFT, 110, 200), moved_to(RIGHT, 310, 204)
    result = associate(cars, [AROUND_BOTH], road(left, right))
    assert result.cars == cars
    assert [car.id for car in result.cars] == [3, 5]
    assert boxes_of(result) == {cars[0]: left, cars[1]: right}
    assert [place.centroid for place in result.assigned.values()] == [left.center, right.center]


# Rules 6 to 8 and 11: one car and one region
WIDE = Box.sized(100, 200, 320, 80)


@pytest.mark.parametrize(
    ("car", "region", "added", "cars"),
    [
        (LEFT, Box.sized(110, 200, 66, 80), False, 1),  # two thirds of its width
        (LEFT, Box.sized(110, 200, 67, 80), True, 1),
        (LEFT, Box.sized(110, 200, 250, 80), True, 1),
        (WIDE, Box.sized(150, 200, 200, 80), False, 1),  # 200 pixels are enough for any car
        (WIDE, Box.sized(150, 200, 201, 80), True, 1),
        (LEFT, Box.sized(250, 200, 80, 80), True, 1),  # 50 pixels are near
        (LEFT, Box.sized(251, 200, 80, 80), False, 2),
        (LEFT, Box.sized(210, 200, 66, 80), False, 1),  # too narrow, and no new car
        (LEFT, Box.sized(210, 200, 67, 80), True, 1),
    ],
)
def test_a_region_of_good_size_in_or_near_a_car_is_added_to_it(
    car: Box, region: Box, added: bool, cars: int
) -> None:
    known = a_car(car, road())
    result = associate([known], [region])
    assert (known in result.assigned, len(result.cars)) == (added, cars)


@pytest.mark.parametrize(("peak", "needed"), [(4.0, 10), (4.1, 3)])
def test_a_peak_above_4_makes_a_known_or_a_new_car_need_only_3_detections(
    peak: float, needed: int
) -> None:
    known, far = a_car(LEFT, road()), Box.sized(600, 200, 90, 80)
    result = associate([known], [LEFT, far], peak=peak)
    old, new = result.cars
    assert (old, old.needed) == (known, needed)
    assert boxes_of(result) == {known: LEFT, new: far}
    assert (new.needed, new.id, new.in_a_row) == (needed, None, 0)


def test_of_two_near_cars_the_nearer_gets_the_region() -> None:
    cars = [a_car(LEFT, road()), a_car(RIGHT, road())]
    assert list(associate(cars, [Box.sized(225, 200, 80, 80)]).assigned) == [cars[1]]


def test_of_two_near_cars_the_one_without_a_region_goes_first() -> None:
    cars = [a_car(LEFT, road()), a_car(RIGHT, road())]
    beside = Box.sized(225, 200, 80, 80)
    assert boxes_of(associate(cars, [RIGHT, beside])) == {cars[1]: RIGHT, cars[0]: beside}


# Rules 9 and 10
LORRY = Box.sized(100, 200, 200, 100)
ITS_FRONT, ITS_REAR = Box.sized(80, 200, 70, 100), Box.sized(250, 200, 60, 100)
COMBINED = Box.sized(80, 200, 230, 100)


@pytest.mark.parametrize("parts", [[ITS_FRONT, ITS_REAR], [ITS_REAR, ITS_FRONT]])
def test_two_regions_by_a_car_that_make_up_its_size_are_added_as_one(parts: list[Box]) -> None:
    car = a_car(LORRY, road())
    result = associate([car], parts)
    assert boxes_of(result) == {car: COMBINED}
    assert result.assigned[car].centroid == pytest.approx(((70 * 115 + 60 * 280) / 130, 250))
    assert result.cars == [car]


def test_a_region_that_a_car_has_already_is_combined_with_one_beside_it() -> None:
    car = a_car(LORRY, road())
    its_own = Box.sized(90, 200, 150, 100)
    assert boxes_of(associate([car], [ITS_REAR, its_own])) == {car: Box.sized(90, 200, 220, 100)}


def test_regions_that_are_not_the_cars_size_combined_are_judged_alone() -> None:
    car = a_car(LEFT, road())
    left, right = Box.sized(30, 200, 80, 80), Box.sized(190, 200, 80, 80)
    result = associate([car], [left, right])
    assert result.assigned[car].box == left
    assert [boxes_of(result)[new] for new in result.cars if new is not car] == [right]


HIDING = Box.sized(100, 200, 260, 100)
ONE, OTHER = Box.sized(70, 200, 120, 100), Box.sized(250, 200, 110, 100)


@pytest.mark.parametrize("regions", [[ONE, OTHER], [OTHER, ONE]])
def test_regions_of_a_cars_size_but_too_wide_make_two_cars_shown_at_once(
    regions: list[Box],
) -> None:
    car = a_car(HIDING, road(), shown_as=4)
    result = associate([car], regions)
    assert car not in result.cars
    assert boxes_of(result) == dict(zip(result.cars, [OTHER, ONE], strict=True))
    for new, place in result.assigned.items():
        new.see(place, road())
        assert new.is_shown


# Rule 11
def test_a_region_beside_a_car_that_has_its_own_is_a_new_car() -> None:
    car = a_car(LEFT, road())
    beside = Box.sized(220, 200, 90, 80)
    result = associate([car], [LEFT, beside])
    assert result.assigned[car].box == LEFT
    assert [boxes_of(result)[new] for new in result.cars if new is not car] == [beside]
