"""Window sets from the vehicles that were seen."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.config.schema import PerspectiveSettings
from vdet.geometry import Float64Array
from vdet.learn.adapt.windows import fit_windows

SIZE = (1280, 720)
BASE = PerspectiveSettings()
HORIZON = 0.5  # as the search of the base finds it


def seen(least: float, most: float, horizon: float, *, count: int = 200) -> Float64Array:
    """Return boxes on a flat road, of widths from `least` to `most` pixels.

    A vehicle is 1.6 m wide and 1.2 m high, the camera 1.3 m: its bottom lies 1.3 / 1.6 of its width
    below the horizon, a share of the frame's height.
    """
    width = np.geomspace(least, most, count)
    bottom = horizon * SIZE[1] + width * 1.3 / 1.6
    height = width * 1.2 / 1.6
    left = np.linspace(100, 700, count)
    return np.stack([left, bottom - height, width, height], axis=1)


def test_the_horizon_is_where_vehicles_would_have_no_width() -> None:
    fitted = fit_windows(seen(40, 300, 0.2), SIZE, BASE, HORIZON)
    assert fitted.horizon == pytest.approx(0.2, abs=0.005)


def test_a_horizon_with_which_the_vehicles_lie_in_the_rows_is_kept() -> None:
    fitted = fit_windows(seen(40, 300, 0.51), SIZE, BASE, HORIZON)
    assert (fitted.horizon, fitted.highest, fitted.lowest) == (0, BASE.highest, BASE.lowest)


def test_vehicles_of_one_size_do_not_show_the_horizon() -> None:
    assert fit_windows(seen(100, 120, 0.2), SIZE, BASE, HORIZON).horizon == BASE.horizon


def test_the_rows_reach_to_all_vehicles_and_to_those_of_the_base() -> None:
    fitted = fit_windows(seen(40, 300, 0.2), SIZE, BASE, HORIZON)
    assert fitted.highest <= BASE.highest
    assert fitted.lowest >= BASE.lowest


def test_too_few_vehicles_change_nothing() -> None:
    assert fit_windows(seen(40, 300, 0.5, count=20), SIZE, BASE, HORIZON) == BASE


def test_large_vehicles_keep_the_sizes_of_the_base() -> None:
    assert fit_windows(seen(150, 400, 0.5), SIZE, BASE, HORIZON).sizes == BASE.sizes


def test_small_vehicles_get_smaller_windows_close_to_one_another() -> None:
    sizes = fit_windows(seen(50, 300, 0.5), SIZE, BASE, HORIZON).sizes
    assert sizes[0] < BASE.sizes[0]
    assert sizes[-1] == BASE.sizes[-1]
    assert max(large / small for small, large in pairwise(sizes)) < 1.44


@given(st.floats(20, 100), st.floats(110, 600), st.floats(0.1, 0.7))
def test_the_search_takes_hardly_longer(least: float, most: float, horizon: float) -> None:
    fitted = fit_windows(seen(least, most, horizon), SIZE, BASE, HORIZON)

    def effort(sets: PerspectiveSettings) -> float:
        return sum(1 / size for size in sets.sizes) * (sets.lowest - sets.highest)

    assert effort(fitted) <= effort(BASE) * 1.11
    assert list(fitted.sizes) == sorted(fitted.sizes)
