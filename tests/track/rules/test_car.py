import numpy as np
import pytest

from boxing import moved_to
from seed import SEED_TRACKER, tracker_but
from vdet.boxes import Box, Image
from vdet.track.rules.car import Car, Region, find_template

BOX = Box.sized(100, 60, 80, 60)
FRAME = np.random.default_rng(0).integers(0, 256, (240, 320, 3), dtype=np.uint8)


def seen(times: int = 1) -> Car:
    car = Car(SEED_TRACKER)
    for _ in range(times):
        car.see(Region(BOX, (140, 90), 2.0), FRAME)
    return car


def shifted(frame: Image, dx: int, dy: int) -> Image:
    return np.roll(frame, (dy, dx), axis=(0, 1))


def test_box_and_centroid_are_averages_over_the_last_ten_detections() -> None:
    car = seen()
    for i in range(10):
        car.see(Region(Box.sized(10 * i, 20 + i, 60 + 2 * i, 51), (10.0 * i, 5.0), 2.0), FRAME)
    assert car.box == Box.sized(45, 24, 69, 51)
    assert car.centroid == (45.0, 5.0)


def test_matches_in_a_row_are_ended_by_a_region_and_not_by_a_miss() -> None:
    car = seen()
    car.see_match(BOX, FRAME)
    car.miss()
    car.see_match(BOX, FRAME)
    assert car.matches == 2
    car.see(Region(BOX, (140, 90), 2.0), FRAME)
    assert car.matches == 0


def test_the_latest_image_is_searched_around_the_latest_box() -> None:
    car = Car(SEED_TRACKER)
    car.see(Region(Box.sized(0, 0, 60, 60), (30, 30), 2.0), FRAME)
    car.see(Region(BOX, (140, 90), 2.0), FRAME)
    assert car.find_in(shifted(FRAME, 7, -4)) == moved_to(BOX, 107, 56)


# The search for a template

BACKGROUND = 90


def texture(width: int, height: int, seed: int = 0) -> Image:
    rng = np.random.default_rng(seed)
    return rng.integers(0, 256, (height, width, 3), dtype=np.uint8)


def frame_with(piece: Image, x: int, y: int, width: int = 300, height: int = 200) -> Image:
    frame = np.full((height, width, 3), BACKGROUND, np.uint8)
    frame[y : y + piece.shape[0], x : x + piece.shape[1]] = piece
    return frame


def search(
    frame: Image,
    template: Image,
    near: Box,
    *,
    distance: int = 50,
    min_score: float = 0.5,
) -> Box | None:
    settings = tracker_but(match_distance=distance, match_score=min_score)
    return find_template(frame, Region(near, near.center, 0, image=template), settings)


def test_a_moved_template_is_found_to_the_pixel_with_a_perfect_score() -> None:
    piece = texture(60, 40)
    found = search(frame_with(piece, 120, 77), piece, Box.sized(100, 80, 60, 40), min_score=1)
    assert found == Box.sized(120, 77, 60, 40)


def test_a_score_below_the_least_one_is_no_match() -> None:
    frame = frame_with(texture(60, 40, seed=1), 100, 80)
    assert search(frame, texture(60, 40), Box.sized(100, 80, 60, 40), min_score=0.95) is None


def test_the_distance_is_the_longest_way_and_a_straight_line() -> None:
    piece = texture(60, 40)
    near = Box.sized(100, 80, 60, 40)
    assert search(frame_with(piece, 130, 120), piece, near, distance=50) == Box.sized(
        130, 120, 60, 40
    )
    assert search(frame_with(piece, 130, 120), piece, near, distance=49) is None
    assert search(frame_with(piece, 140, 120), piece, near, distance=50) is None


def test_a_place_partly_outside_the_frame_is_searched_where_it_is_inside() -> None:
    piece = texture(60, 40)
    assert search(frame_with(piece, 0, 0), piece, Box.sized(-20, -10, 60, 40)) == Box.sized(
        0, 0, 60, 40
    )


@pytest.mark.parametrize(("width", "height"), [(301, 40), (60, 201)])
def test_a_template_larger_than_the_frame_has_no_match(width: int, height: int) -> None:
    frame = np.full((200, 300, 3), BACKGROUND, np.uint8)
    assert (
        search(frame, texture(width, height), Box.sized(0, 0, width, height), min_score=0) is None
    )


@pytest.mark.parametrize("color", [(0, 0, 0), (BACKGROUND,) * 3, (10, 200, 90)])
def test_a_template_of_one_colour_has_no_match(color: tuple[int, int, int]) -> None:
    piece = np.full((40, 60, 3), color, np.uint8)
    frame = frame_with(piece, 100, 80)
    assert search(frame, piece, Box.sized(100, 80, 60, 40)) is None
