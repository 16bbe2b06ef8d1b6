from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vdet.boxes import Int32Array
from vdet.config.kinds import WindowSettings
from vdet.detect.svm.windows import WindowGrid, Windows, band_grid

ROWS = 2000  # of a frame that is higher than all bands here


def band(size: int, overlap: float, top: int, bottom: int) -> WindowSettings:
    return WindowSettings(size=size, overlap=overlap, top=top, bottom=bottom)


def boxes_of(settings: WindowSettings, width: int, height: int = ROWS) -> Int32Array:
    return band_grid(settings, width, height).boxes


def test_step_and_buffer_are_truncated() -> None:
    # size 20, overlap 0.33: step int(13.4) = 13, buffer int(6.6) = 6, columns (100 - 6) // 13 = 7
    assert boxes_of(band(20, 0.33, 0, 20), 100)[:, 0].tolist() == [0, 13, 26, 39, 52, 65, 78]


def test_a_band_that_lost_a_row_to_rounding_still_has_its_windows() -> None:
    low = band(64, 0.5, 0, 64).model_copy(update={"bottom": 63})  # as after scaling
    np.testing.assert_array_equal(boxes_of(low, 640), boxes_of(band(64, 0.5, 0, 64), 640))


@given(
    st.integers(8, 200),
    st.floats(0, 0.99),
    st.integers(0, 300),
    st.integers(0, 400),
    st.integers(1, 900),
)
def test_all_windows_lie_inside_band_and_frame(
    size: int, overlap: float, top: int, spare: int, width: int
) -> None:
    assume(int(size * (1 - overlap)) >= 1)
    settings = band(size, overlap, top, top + size + spare)
    x, y, w, h = boxes_of(settings, width).T
    assert (x >= 0).all()
    assert (x + w <= width).all()
    assert (y >= top).all()
    assert (y + h <= settings.bottom).all()
    assert ((w == size) & (h == size)).all()


def test_the_weight_is_one_over_the_number_of_windows_that_cover_a_pixel() -> None:
    grid = band_grid(band(64, 0.75, 0, 320), 320, 320)
    covered = np.zeros((320, 320))
    for x, y, w, h in grid.boxes.tolist():
        covered[y : y + h, x : x + w] += 1
    assert covered[160, 160] == 16
    assert grid.weight == 1 / 16


@pytest.mark.parametrize("n", [1, 2, 3, 50])
def test_the_grids_of_every_nth_window_together_are_the_whole_grid(n: int) -> None:
    grid = WindowGrid(100, Fraction(25, 2), Fraction(0), Fraction(40), columns=37, rows=13)
    parts = [grid.every_nth(n, column, row) for column in range(n) for row in range(n)]
    together = np.concatenate([part.boxes for part in parts])
    assert len(together) == sum(len(part) for part in parts) == len(grid)
    assert {tuple(box) for box in together.tolist()} == {tuple(b) for b in grid.boxes.tolist()}


def test_hits_are_the_windows_of_at_least_the_probability_in_order() -> None:
    boxes = np.arange(16, dtype=np.int32).reshape(4, 4)
    probabilities = np.array([0.5, 0.25, 0.75, 0.499], np.float32)
    weights = np.array([1, 0.5, 0.25, 0.125], np.float32)
    vehicles = boxes.astype(np.float32) + 0.5
    windows = Windows(boxes, probabilities, weights, vehicles)
    found = windows.hits(0.5)
    assert found.boxes.tolist() == [[0, 1, 2, 3], [8, 9, 10, 11]]
    assert found.probabilities.tolist() == [0.5, 0.75]
    assert found.weights.tolist() == [1, 0.25]
    assert found.vehicles.tolist() == [[0.5, 1.5, 2.5, 3.5], [8.5, 9.5, 10.5, 11.5]]
    assert len(windows) == 4
    assert len(found) == 2
