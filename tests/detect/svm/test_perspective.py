from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.config.kinds import FeatureSettings, PerspectiveSettings
from vdet.detect.svm.windows import WindowGrid, perspective_grids

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
        halved = grid.size
        divisor = 1
        while halved > 2 * FEATURES.patch:
            divisor *= 2
            halved = grid.size // divisor
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
    grids = laid(width, height)
    assert [grid.size for grid in grids] == sizes
    for grid in grids:
        top, bottom = rows_of(grid)
        assert 0 <= top < bottom <= height
        assert min(grid.columns, grid.rows) >= 1


@given(st.integers(1, 400), st.integers(1, 400), st.floats(0, 1), st.floats(0.01, 1))
def test_windows_lie_inside_the_rows_of_any_frame(
    width: int, height: int, horizon: float, size: float
) -> None:
    for grid in laid(width, height, horizon, sizes=(size,)):
        boxes = grid.boxes
        assert len(boxes) == len(grid) > 0
        assert boxes[:, 1].min() >= 0
        assert (boxes[:, 1] + boxes[:, 3]).max() <= height
