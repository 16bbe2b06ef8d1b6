import numpy as np
import pytest

from vdet.geometry import Box
from vdet.track.rules.template import Image, MatchMethod, find

METHODS: list[MatchMethod] = ["ccoeff_normed", "ccorr_normed", "sqdiff_normed"]
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
    method: MatchMethod = "ccoeff_normed",
    min_score: float = 0.5,
) -> Box | None:
    return find(frame, template, near, distance=distance, method=method, min_score=min_score)


@pytest.mark.parametrize("method", METHODS)
def test_a_moved_template_is_found_to_the_pixel_with_a_perfect_score(method: MatchMethod) -> None:
    piece = texture(60, 40)
    found = search(
        frame_with(piece, 120, 77), piece, Box(100, 80, 60, 40), method=method, min_score=1
    )
    assert found == Box(120, 77, 60, 40)


@pytest.mark.parametrize("method", METHODS)
def test_a_score_below_the_least_one_is_no_match(method: MatchMethod) -> None:
    frame = frame_with(texture(60, 40, seed=1), 100, 80)
    assert (
        search(frame, texture(60, 40), Box(100, 80, 60, 40), method=method, min_score=0.95) is None
    )


def test_noise_lowers_the_score() -> None:
    piece = texture(60, 40)
    noise = np.random.default_rng(5).integers(0, 128, piece.shape, dtype=np.uint8)
    frame = frame_with(piece // 2 + noise, 100, 80)
    assert search(frame, piece, Box(100, 80, 60, 40), min_score=0.6) == Box(100, 80, 60, 40)
    assert search(frame, piece, Box(100, 80, 60, 40), min_score=0.9) is None


def test_the_distance_is_the_longest_way_and_a_straight_line() -> None:
    piece = texture(60, 40)
    near = Box(100, 80, 60, 40)
    assert search(frame_with(piece, 130, 120), piece, near, distance=50) == Box(130, 120, 60, 40)
    assert search(frame_with(piece, 130, 120), piece, near, distance=49) is None
    assert search(frame_with(piece, 140, 120), piece, near, distance=50) is None


def test_with_no_distance_only_the_old_place_counts() -> None:
    piece = texture(60, 40)
    near = Box(100, 80, 60, 40)
    assert search(frame_with(piece, 100, 80), piece, near, distance=0) == near
    assert search(frame_with(piece, 101, 80), piece, near, distance=0) is None


@pytest.mark.parametrize(("x", "y"), [(0, 0), (240, 160), (0, 160)])
def test_a_template_is_found_in_the_corner_of_a_frame(x: int, y: int) -> None:
    piece = texture(60, 40)
    near = Box(min(x + 20, 240), max(y - 20, 0), 60, 40)
    assert search(frame_with(piece, x, y), piece, near) == Box(x, y, 60, 40)


def test_a_place_partly_outside_the_frame_is_searched_where_it_is_inside() -> None:
    piece = texture(60, 40)
    assert search(frame_with(piece, 0, 0), piece, Box(-20, -10, 60, 40)) == Box(0, 0, 60, 40)


@pytest.mark.parametrize("near", [Box(900, 80, 60, 40), Box(-900, 80, 60, 40)])
def test_a_place_far_outside_the_frame_has_no_match(near: Box) -> None:
    piece = texture(60, 40)
    assert search(frame_with(piece, 0, 0), piece, near) is None


@pytest.mark.parametrize(("width", "height"), [(301, 40), (60, 201)])
def test_a_template_larger_than_the_frame_has_no_match(width: int, height: int) -> None:
    frame = np.full((200, 300, 3), BACKGROUND, np.uint8)
    assert search(frame, texture(width, height), Box(0, 0, width, height), min_score=0) is None


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("color", [(0, 0, 0), (BACKGROUND,) * 3, (10, 200, 90)])
def test_a_template_of_one_colour_has_no_match(
    method: MatchMethod, color: tuple[int, int, int]
) -> None:
    piece = np.full((40, 60, 3), color, np.uint8)
    frame = frame_with(piece, 100, 80)
    assert search(frame, piece, Box(100, 80, 60, 40), method=method) is None


def test_an_empty_template_has_no_match() -> None:
    frame = np.full((200, 300, 3), BACKGROUND, np.uint8)
    assert search(frame, frame[:0], Box(0, 0, 300, 0), min_score=0) is None


@pytest.mark.parametrize("level", [0, BACKGROUND, 255])
def test_nothing_is_found_in_a_frame_of_one_colour(level: int) -> None:
    frame = np.full((200, 300, 3), level, np.uint8)
    assert search(frame, texture(60, 40), Box(100, 80, 60, 40)) is None


def test_the_method_decides_what_fits() -> None:
    piece = texture(60, 40) // 2
    brighter = frame_with(piece + 100, 100, 80)
    near = Box(100, 80, 60, 40)
    assert search(brighter, piece, near, method="ccoeff_normed", min_score=0.99) == near
    assert search(brighter, piece, near, method="sqdiff_normed", min_score=0.99) is None
