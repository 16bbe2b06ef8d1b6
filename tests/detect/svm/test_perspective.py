import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.config.svm import FeatureSettings, PerspectiveSettings
from vdet.detect.svm.windows import WindowGrid, lay_perspective

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
    return lay_perspective(settings, features, width, height, horizon=horizon)


def rows_of(grid: WindowGrid) -> tuple[int, int]:
    """Return the first row of the highest windows, and the first below the lowest."""
    boxes = grid.boxes
    return int(boxes[0, 1]), int(boxes[-1, 1] + boxes[-1, 3])


class TestSizes:
    def test_sizes_are_shares_of_the_frames_width_in_their_order(self) -> None:
        assert [grid.size for grid in laid()] == [round(1280 * share) for share in SIZES]
        assert [grid.size for grid in laid(sizes=(0.25, 0.05))] == [320, 64]

    @pytest.mark.parametrize(("zoom", "size"), [(0.5, 64), (1, 128), (1.5, 192), (2, 256)])
    def test_sizes_are_multiplied_by_the_zoom(self, zoom: float, size: int) -> None:
        (grid,) = laid(sizes=(0.1,), zoom=zoom, horizon=0.3)
        assert grid.size == size

    def test_sizes_in_a_wider_frame_are_those_of_a_frame_of_16_by_9(self) -> None:
        assert [grid.size for grid in laid(2560, 720)] == [grid.size for grid in laid(1280, 720)]

    @given(st.floats(0.02, 0.4), st.sampled_from([320, 640, 854, 960, 1242, 1280, 1920]))
    def test_sizes_are_rounded_by_no_more_than_a_cell(self, share: float, width: int) -> None:
        (grid,) = laid(width, 2 * width, sizes=(share,), horizon=0.3)
        cell = share * width * FEATURES.hog.cell / FEATURES.patch
        assert abs(grid.size - share * width) <= max(cell, 4)

    def test_sizes_that_are_rounded_to_the_same_are_laid_once(self) -> None:
        # 16 and 20 pixels would both be 16, windows of whole cells: their hits would count twice
        assert [grid.size for grid in laid(320, 180, sizes=(0.05, 0.0625, 0.125))] == [16, 40]


class TestRows:
    @pytest.mark.parametrize("horizon", [0.35, 0.5, 0.6])
    @pytest.mark.parametrize(("highest", "lowest"), [(0.6, 1.1), (0.8, 0.8), (0, 0.5)])
    def test_windows_end_below_the_horizon_by_a_number_of_their_sides(
        self, horizon: float, highest: float, lowest: float
    ) -> None:
        grids = laid(height=2000, horizon=horizon, highest=highest, lowest=lowest)
        assert len(grids) == len(SIZES)
        for grid in grids:
            rounding = max(1, grid.size / FEATURES.patch) / 2
            top, bottom = rows_of(grid)
            first, last = top + grid.size - horizon * 2000, bottom - horizon * 2000
            assert abs(first - highest * grid.size) <= rounding
            assert abs(last - lowest * grid.size) <= rounding + grid.step / 2

    def test_rows_below_the_frame_are_left_out(self) -> None:
        whole = laid(height=2000, horizon=0.3, sizes=(0.25,), highest=0.5, lowest=1.5)[0]
        bottom = rows_of(whole)[1] - 100
        (grid,) = laid(height=bottom, horizon=600 / bottom, sizes=(0.25,), highest=0.5, lowest=1.5)
        assert grid.top == whole.top
        assert grid.rows == whole.rows - math.ceil(100 / grid.step)

    def test_a_set_that_would_begin_too_low_is_left_out(self) -> None:
        sizes = [grid.size for grid in laid(horizon=0.9)]
        assert sizes == [size for size in (64, 80, 112, 160, 224, 320) if 0.6 * size <= 72]


class TestBeyondTheSides:
    @pytest.mark.parametrize("beyond", [0, 0.25, 0.5, 1])
    def test_windows_reach_beyond_both_sides_by_a_share_of_their_size(self, beyond: float) -> None:
        for grid in laid(beyond=beyond):
            x = grid.boxes[:, 0]
            assert x.min() == -beyond * grid.size
            over = int(x.max()) + grid.size - 1280
            assert beyond * grid.size - grid.step < over <= beyond * grid.size


class TestHalving:
    @pytest.mark.parametrize(("width", "height"), FRAMES)
    @pytest.mark.parametrize("horizon", [0.4, 0.57, 0.61])
    def test_windows_lie_at_whole_pixels_of_every_halved_frame(
        self, width: int, height: int, horizon: float
    ) -> None:
        for grid in laid(width, height, horizon):
            halved = grid.size
            divisor = 1
            while halved > 2 * FEATURES.patch:
                divisor *= 2
                halved = grid.size // divisor
            lengths = (grid.size, grid.left, grid.top, grid.step)
            assert [Fraction(length) % divisor for length in lengths] == [0, 0, 0, 0]

    def test_a_step_is_a_cell(self) -> None:
        for grid in laid():
            assert grid.step == Fraction(grid.size, 8)


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
    grids = laid(width, height)
    assert [grid.size for grid in grids] == sizes
    for grid in grids:
        top, bottom = rows_of(grid)
        assert 0 <= top < bottom <= height
        assert min(grid.columns, grid.rows) >= 1


@given(st.integers(1, 400), st.integers(1, 400), st.floats(0, 1), st.floats(0.1, 10))
def test_windows_lie_inside_the_rows_of_any_frame(
    width: int, height: int, horizon: float, zoom: float
) -> None:
    for grid in laid(width, height, horizon, zoom=zoom):
        boxes = grid.boxes
        assert len(boxes) == len(grid) > 0
        assert boxes[:, 1].min() >= 0
        assert (boxes[:, 1] + boxes[:, 3]).max() <= height
