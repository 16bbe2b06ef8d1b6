import numpy as np
import pytest

from boxing import moved_to
from seed import SEED_TRACKER, tracker_but
from vdet.boxes import Box, Image
from vdet.track.rules import Car, Region

BOX = Box.sized(100, 60, 80, 60)
FRAME = np.random.default_rng(0).integers(0, 256, (240, 320, 3), dtype=np.uint8)


SEEN = Region(BOX, (140, 90), 2.0)


def test_matches_in_a_row_are_ended_by_a_region_and_not_by_a_miss() -> None:
    car = Car(SEED_TRACKER)
    car.see(SEEN, FRAME, by_match=True)
    car.miss()
    car.see(SEEN, FRAME, by_match=True)
    assert car.matches == 2
    car.see(SEEN, FRAME)
    assert car.matches == 0


GREY = np.full((200, 300, 3), 90, np.uint8)
PLACE = Box.sized(100, 80, 60, 40)


def texture(seed: int = 0) -> Image:
    return np.random.default_rng(seed).integers(0, 256, (40, 60, 3), dtype=np.uint8)


def frame_with(piece: Image, x: float, y: float) -> Image:
    frame = GREY.copy()
    moved_to(PLACE, x, y).cut(frame)[:] = piece
    return frame


def search(
    frame: Image, piece: Image | None = None, near: Box = PLACE, **changes: object
) -> Box | None:
    """Search a car that was seen at `near` before, where it looked like `piece`."""
    car = Car(tracker_but(**changes))
    before = frame_with(texture() if piece is None else piece, near.x1, near.y1)
    car.see(Region(near, near.center, 0), before)
    found = car.find_in(frame)
    return found.box if found else None


def test_a_moved_image_is_found_to_the_pixel_with_a_perfect_score() -> None:
    found = search(frame_with(texture(), 120, 77), match_score=1)
    assert found == Box.sized(120, 77, 60, 40)


def test_a_score_below_the_least_one_is_no_match() -> None:
    assert search(frame_with(texture(seed=1), 100, 80), match_score=0.95) is None


@pytest.mark.parametrize(
    ("x", "distance", "is_found"), [(130, 50, True), (130, 49, False), (140, 50, False)]
)
def test_the_distance_is_the_longest_way_and_a_straight_line(
    x: int, distance: int, is_found: bool
) -> None:
    found = search(frame_with(texture(), x, 120), match_distance=distance)
    assert found == (Box.sized(x, 120, 60, 40) if is_found else None)


@pytest.mark.parametrize("color", [(0, 0, 0), (90, 90, 90), (10, 200, 90)])
def test_an_image_of_one_colour_has_no_match(color: tuple[int, int, int]) -> None:
    piece = np.full((40, 60, 3), color, np.uint8)
    assert search(frame_with(piece, 100, 80), piece) is None
