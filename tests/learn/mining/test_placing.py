import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.learn.mining.placing import Placing, place

WIDTH = 1000
CAR = (400, 300, 100, 70)  # x, y, width, height
MIDDLE = (450, 335)


def window(side: float, x: float = MIDDLE[0], y: float = MIDDLE[1]) -> tuple[float, ...]:
    """Return a window centred on a point."""
    return (x - side / 2, y - side / 2, side, side)


def placed(*windows: tuple[float, ...], vehicle: tuple[float, ...] = CAR) -> Placing:
    return place(np.array(windows, np.float64), np.array(vehicle, np.float64), WIDTH)


def word(*windows: tuple[float, ...], vehicle: tuple[float, ...] = CAR) -> str:
    """Return the flags of each window as words."""
    found = placed(*windows, vehicle=vehicle)
    words = []
    for i in range(len(windows)):
        flags = {"fits": found.fits[i], "shows": found.shows[i], "part": found.part[i]}
        words.append("+".join(name for name, on in flags.items() if on) or "-")
    return " ".join(words)


def test_sides_are_measured_from_the_centre_of_the_window_in_its_sides() -> None:
    found = placed((400, 285, 100, 100), (350, 235, 200, 200), (380, 285, 100, 100))
    np.testing.assert_allclose(
        found.sides,
        [[-0.5, -0.35, 0.5, 0.35], [-0.25, -0.175, 0.25, 0.175], [-0.3, -0.35, 0.7, 0.35]],
    )
    np.testing.assert_allclose(found.distances, [0, 0, 0.2])


@pytest.mark.parametrize(
    ("side", "expected"),
    [
        (34, "part"),
        (39, "part"),
        (41, "shows+part"),
        (53, "shows+part"),
        (55, "shows"),
        (70, "shows"),
        (80, "fits"),
        (100, "fits"),
        (135, "fits"),
        (150, "shows"),
        (170, "shows"),
        (245, "shows"),
        (255, "-"),
    ],
)
def test_a_window_fits_a_vehicle_about_as_wide_as_itself(side: float, expected: str) -> None:
    assert word(window(side)) == expected


@pytest.mark.parametrize(
    ("shift", "expected"), [(15, "fits"), (20, "shows"), (44, "shows"), (46, "-"), (80, "-")]
)
@pytest.mark.parametrize("way", [-1, 1])
def test_a_window_off_the_centre_shows_the_vehicle(shift: float, expected: str, way: int) -> None:
    assert word(window(100, MIDDLE[0] + way * shift)) == expected


def test_a_small_window_off_the_centre_of_a_vehicle_shows_a_part_of_it() -> None:
    windows = (window(36, MIDDLE[0] + shift) for shift in (0, 15, 40, 48, 52))
    assert word(*windows) == "part part part part -"
    assert word(window(50, y=330), window(50, y=369), window(50, y=371)) == "shows+part part -"


def test_a_small_window_shows_a_part_of_a_cut_off_vehicle_too() -> None:
    for vehicle, x in ((RIGHT, 950), (LEFT, 50)):
        assert word(window(36, x), window(36, 500), vehicle=vehicle) == "part -"


def test_a_window_too_high_or_too_low_shows_the_vehicle_or_nothing() -> None:
    heights = (window(100, y=MIDDLE[1] + shift) for shift in (10, 20, 30, -20, -30))
    assert word(*heights) == "fits shows - shows -"


def test_windows_that_fit_or_show_a_vehicle_or_are_of_similar_size_are_near_it() -> None:
    found = placed(window(100), window(150), window(36), window(200), window(20), window(100, 200))
    assert found.near.tolist() == [True, True, True, True, False, False]


RIGHT = (900, 300, 100, 70)  # its right side is beyond the frame
LEFT = (0, 300, 100, 70)


def test_the_cut_off_side_of_a_vehicle_is_unknown() -> None:
    for vehicle, unknown in ((RIGHT, 2), (LEFT, 0)):
        sides = placed(window(140, 950), vehicle=vehicle).sides[0]
        assert np.flatnonzero(np.isnan(sides)).tolist() == [unknown]


@pytest.mark.parametrize("vehicle", [(899, 300, 99.5, 70), (1, 300, 100, 70)])
def test_a_box_very_close_to_the_side_of_the_frame_is_cut_off(
    vehicle: tuple[float, ...],
) -> None:
    assert np.isnan(placed(window(140, 950), vehicle=vehicle).sides).any()


def test_a_window_fits_a_cut_off_vehicle_by_its_visible_side_and_its_height() -> None:
    side = 140
    windows = [window(side, 900 + share * side) for share in (0.1, 0.25, 0.45, 0.6, 0.7, 0.9)]
    assert word(*windows, vehicle=RIGHT) == "- shows fits fits shows -"
    mirrored = [window(side, 100 - share * side) for share in (0.1, 0.25, 0.45, 0.6, 0.7, 0.9)]
    assert word(*mirrored, vehicle=LEFT) == "- shows fits fits shows -"
    sizes = [window(side, 900 + 0.45 * side) for side in (60, 78, 100, 150, 190, 300)]
    assert word(*sizes, vehicle=RIGHT) == "- shows fits fits shows -"


def test_no_window_fits_a_vehicle_that_fills_the_frame() -> None:
    vehicle = (0, 100, 1000, 400)
    found = placed(window(400, 500, 300), vehicle=vehicle)
    assert word(window(400, 500, 300), window(1000, 500, 300), vehicle=vehicle) == "- -"
    assert np.isnan(found.sides[0, [0, 2]]).all()


@given(
    st.tuples(st.floats(-200, 1200), st.floats(0, 600), st.floats(20, 500)),
    st.tuples(st.floats(0, 900), st.floats(0, 500), st.floats(10, 100), st.floats(10, 100)),
)
def test_a_mirrored_scene_gives_the_same(at: tuple[float, ...], vehicle: tuple[float, ...]) -> None:
    x, y, side = at
    ours = placed((x, y, side, side), vehicle=vehicle)
    there = (WIDTH - vehicle[0] - vehicle[2], *vehicle[1:])
    theirs = placed((WIDTH - x - side, y, side, side), vehicle=there)
    np.testing.assert_allclose(
        theirs.sides[:, [2, 1, 0, 3]] * [-1, 1, -1, 1], ours.sides, atol=1e-6
    )
    for flags in ("fits", "shows", "part", "near"):
        assert getattr(ours, flags) == getattr(theirs, flags)
    assert not (ours.fits[0] and (ours.shows[0] or ours.part[0]))
    assert ours.near[0] >= (ours.fits[0] or ours.shows[0])
