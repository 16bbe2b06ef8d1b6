"""Where windows lie: in bands, by the perspective, and by the horizon of drawn roads."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vdet.boxes import Image, Int32Array
from vdet.config.kinds import FeatureSettings, PerspectiveSettings, WindowSettings
from vdet.detect.svm.windows import WindowGrid, band_grid, find_horizon, perspective_grids
from vdet.synthetic import PinholeCamera, empty_road, frames

ROWS = 2000  # of a frame that is higher than all bands here


def band(size: int, overlap: float, top: int, bottom: int) -> WindowSettings:
    return WindowSettings(size=size, overlap=overlap, top=top, bottom=bottom)


def boxes_of(settings: WindowSettings, width: int, height: int = ROWS) -> Int32Array:
    return band_grid(settings, width, height).boxes


def test_step_and_buffer_are_truncated() -> None:
    # size 20, overlap 0.33: step int(13.4) = 13, buffer int(6.6) = 6, columns (100 - 6) // 13 = 7
    assert boxes_of(band(20, 0.33, 0, 20), 100)[:, 0].tolist() == [0, 13, 26, 39, 52, 65, 78]


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


FEATURES = FeatureSettings()
SIZES = PerspectiveSettings().sizes
FRAMES = [(1280, 720), (960, 540), (1242, 375), (1920, 1080), (854, 480), (96, 64)]


def laid(
    width: int = 1280,
    height: int = 720,
    horizon: float = 0.55,
    features: FeatureSettings = FEATURES,
    **changes: object,
) -> list[WindowGrid]:
    settings = PerspectiveSettings.model_validate(changes)
    return perspective_grids(settings, features, width, height, horizon=horizon)


def rows_of(grid: WindowGrid) -> tuple[int, int]:
    """Return the first row of the highest windows, and the first below the lowest."""
    boxes = grid.boxes
    return int(boxes[0, 1]), int(boxes[-1, 1] + boxes[-1, 3])


@pytest.mark.parametrize("horizon", [0.35, 0.5, 0.6])
def test_windows_end_below_the_horizon_by_0_6_to_1_1_of_their_sides(horizon: float) -> None:
    grids = laid(height=2000, horizon=horizon)
    assert len(grids) == len(SIZES)
    for grid in grids:
        rounding = max(1, grid.size / FEATURES.patch) / 2
        top, bottom = rows_of(grid)
        first, last = top + grid.size - horizon * 2000, bottom - horizon * 2000
        assert abs(first - 0.6 * grid.size) <= rounding
        assert abs(last - 1.1 * grid.size) <= rounding + grid.step / 2


def test_windows_reach_beyond_both_sides_by_whole_steps_of_at_most_0_7() -> None:
    for grid in laid():
        x = grid.boxes[:, 0]
        beyond = 5 / 8 * grid.size
        assert x.min() == -beyond
        over = int(x.max()) + grid.size - 1280
        assert beyond - grid.step < over <= beyond


@pytest.mark.parametrize(("width", "height"), FRAMES)
@pytest.mark.parametrize("horizon", [0.4, 0.57, 0.61])
def test_windows_lie_at_whole_pixels_of_every_halved_frame(
    width: int, height: int, horizon: float
) -> None:
    for grid in laid(width, height, horizon):
        divisor = 1
        while grid.size // divisor > 2 * FEATURES.patch:
            divisor *= 2
        lengths = (grid.size, grid.left, grid.top, grid.step)
        assert [Fraction(length) % divisor for length in lengths] == [0, 0, 0, 0]


@pytest.mark.parametrize(
    ("width", "height", "sizes"),
    [
        (1280, 720, [64, 80, 112, 160, 224, 320, 384]),
        (960, 540, [48, 64, 80, 128, 160, 256]),
        (1242, 375, [32, 40, 56, 80, 112, 160, 192]),
        (1920, 1080, [96, 128, 160, 256, 320, 512]),
        (96, 64, [8, 16, 24, 32]),
    ],
)
def test_the_default_sets_in_frames_of_other_shapes(
    width: int, height: int, sizes: list[int]
) -> None:
    assert [grid.size for grid in laid(width, height)] == sizes


@given(st.integers(1, 400), st.integers(1, 400), st.floats(0, 1), st.floats(0.01, 1))
def test_windows_lie_inside_the_rows_of_any_frame(
    width: int, height: int, horizon: float, size: float
) -> None:
    for grid in laid(width, height, horizon, sizes=(size,)):
        boxes = grid.boxes
        assert len(boxes) == len(grid) > 0
        assert boxes[:, 1].min() >= 0
        assert (boxes[:, 1] + boxes[:, 3]).max() <= height


STEP = 0.01  # between the rows that get votes
RNG = np.random.default_rng(0)


def road(horizon: float, *, curvature: float = 0, lane: int = 0, lanes: int = 3) -> list[Image]:
    """Draw three frames of an empty road."""
    camera = PinholeCamera(640, 360, 600, horizon * 360, 1.3, curvature)
    scene = empty_road(np.random.default_rng(7), camera, lane=lane, lanes=lanes, seed=7)
    return [frame.image for frame in frames(replace(scene, frames=3))]


@pytest.mark.parametrize(
    ("horizon", "curvature", "lane", "lanes"),
    [
        *((horizon, 0, 0, 3) for horizon in (0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65)),
        *((0.5, -1 / 600, lane, lanes) for lane, lanes in ((0, 2), (1, 2), (1, 3))),
        *((0.5, 1 / 1000, lane, lanes) for lane, lanes in ((0, 2), (1, 2), (1, 3))),
    ],
)
def test_the_lines_of_a_road_meet_at_the_horizon_in_any_lane_and_bend(
    horizon: float, curvature: float, lane: int, lanes: int
) -> None:
    images = road(horizon, curvature=curvature, lane=lane, lanes=lanes)
    assert find_horizon(images) == pytest.approx(horizon, abs=STEP * (2 if curvature else 1))


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((180, 320, 3), np.uint8),
        np.full((180, 320, 3), 255, np.uint8),
        RNG.integers(0, 256, (180, 320, 3), dtype=np.uint8),
        np.repeat(RNG.integers(0, 256, (1, 320, 3), dtype=np.uint8), 180, axis=0),
        np.zeros((1, 1, 3), np.uint8),
        np.zeros((1, 500, 3), np.uint8),
    ],
    ids=["black", "white", "noise", "upright lines", "a pixel", "a row"],
)
def test_without_lines_there_is_no_horizon(image: Image) -> None:
    assert find_horizon([image]) is None
