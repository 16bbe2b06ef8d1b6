"""The dense engine: which grids and features it searches, and that results are in their place.

A texture that is drawn into one window must be found in that window.
"""

from fractions import Fraction

import cv2
import numpy as np
import pytest
from benchmarks.patch_search import PatchSearch

from vdet.boxes import Image
from vdet.config.svm import FeatureSettings, HistogramSettings, HogSettings
from vdet.detect.svm.dense_search import DenseSearch
from vdet.detect.svm.features import FeatureExtractor
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.windows import WindowGrid
from vdet.media import Picture

FEATURES = FeatureSettings(
    patch=64, hog=HogSettings(cell=8), histogram=HistogramSettings(bins=None)
)
GRIDS = [  # whole cells, one and a half, and other distances
    (64, 8),
    (64, 16),
    (64, 24),
    (128, 16),
    (64, 12),
    (128, 24),
    (48, 9),
    (64, 7),
    (128, 25),
    (96, 19),
    (48, 7),
    (80, 13),
]


def texture(side: int) -> Image:
    coarse = np.random.default_rng(3).integers(0, 256, (8, 8, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(coarse, (side, side), interpolation=cv2.INTER_CUBIC), np.uint8)


def texture_finder(members: int) -> LinearModel:
    """Return a model for which the texture is the most probable vehicle."""
    vector = FeatureExtractor(FEATURES).describe(texture(64))
    weights = np.tile(vector / np.linalg.norm(vector) ** 2, (members, 1))
    return LinearModel(
        FEATURES,
        weights,
        biases=np.full(members, -0.7, np.float32),
        slopes=np.full(members, -8, np.float32),
        offsets=np.linspace(-1, 1, members, dtype=np.float32)
        if members > 1
        else np.zeros(1, np.float32),
    )


@pytest.mark.parametrize(("size", "step"), GRIDS)
@pytest.mark.parametrize("members", [1, 2])
def test_a_texture_is_most_probable_in_the_window_that_it_fills(
    size: int, step: int, members: int
) -> None:
    grid = WindowGrid(size, Fraction(step), Fraction(4), Fraction(6), 7, 5)
    model = texture_finder(members)
    search = DenseSearch(model, grid)
    for index in (0, 6, 9, 17, 28, 34):
        x, y, w, h = grid.boxes[index].tolist()
        frame = np.full((2 * size + 6 * step, 2 * size + 8 * step, 3), 100, np.uint8)
        frame[y : y + h, x : x + w] = texture(size)
        found = search.search(FramePyramid(Picture(frame), FEATURES)).probabilities
        assert found.shape == (35,)
        assert found.dtype == np.float32
        assert int(found.argmax()) == index


@pytest.mark.parametrize(("size", "step"), GRIDS)
@pytest.mark.parametrize(("columns", "rows"), [(1, 1), (1, 4), (5, 1), (2, 2)])
def test_a_grid_may_be_a_window_a_row_or_a_column(
    size: int, step: int, columns: int, rows: int
) -> None:
    grid = WindowGrid(size, Fraction(step), Fraction(0), Fraction(3), columns, rows)
    model = texture_finder(1)
    frame = FramePyramid(Picture(texture(256)), FEATURES)
    search = DenseSearch(model, grid)
    expected = PatchSearch(model, grid).search(frame).probabilities
    np.testing.assert_allclose(search.search(frame).probabilities, expected, atol=0.1)


@pytest.mark.parametrize(("size", "step"), GRIDS)
def test_the_hog_features_of_a_window_give_its_probability(size: int, step: int) -> None:
    grid = WindowGrid(size, Fraction(step), Fraction(4), Fraction(6), 7, 5)
    model = texture_finder(2)
    search = DenseSearch(model, grid)
    found = search.search(FramePyramid(Picture(texture(400)), FEATURES))
    numbers = np.random.default_rng(1).permutation(len(grid))
    hogs = found.hogs(numbers)
    assert hogs.shape == (len(grid), FeatureExtractor(FEATURES).layout.hog_length)
    assert hogs.dtype == np.float32
    expected = model.probabilities(hogs)  # there are no other features
    np.testing.assert_allclose(found.probabilities[numbers], expected, atol=1e-5)
    assert len(np.unique(expected.round(4))) > len(grid) / 2
