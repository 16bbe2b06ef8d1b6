import numpy as np
import pytest

from vdet.config.schema import FeatureSettings, HistogramSettings, HogSettings
from vdet.detect.svm.dense.histogram import table_sums
from vdet.detect.svm.dense.weights import DenseWeights
from vdet.detect.svm.features import Layout
from vdet.detect.svm.model import LinearModel

STRIP = np.random.default_rng(0).integers(0, 256, (40, 70, 3), dtype=np.uint8)
X, Y = np.array([0, 3, 38])[:, np.newaxis], np.array([0, 1, 7, 8])[np.newaxis]


def weights_of(bins: int, members: int) -> tuple[DenseWeights, np.ndarray]:
    """Return a model's sorted weights, and those of its histogram, `(members, 3, bins)`."""
    features = FeatureSettings(
        hog=HogSettings(channels=(0,)), histogram=HistogramSettings.model_validate({"bins": bins})
    )
    layout = Layout.of(features)
    weights = np.random.default_rng(bins).normal(size=(members, layout.length)).astype(np.float32)
    model = LinearModel(features, weights, *np.zeros((3, members), np.float32))
    return DenseWeights.of(model), weights[:, layout.histogram].reshape(members, 3, bins)


@pytest.mark.parametrize("bins", [8, 32, 256])
@pytest.mark.parametrize("members", [1, 3])
def test_a_window_sums_the_weights_of_its_histogram(bins: int, members: int) -> None:
    sorted_weights, weights = weights_of(bins, members)
    sums = table_sums(STRIP, sorted_weights.tables, 32, X, Y)
    assert sums.shape == (members, 3, 4)
    assert sums.dtype == np.float32
    for m, i, j in np.ndindex(*sums.shape):
        x, y = X[i, 0], Y[0, j]
        window = STRIP[y : y + 32, x : x + 32]
        counts = [np.histogram(window[:, :, c], bins, (0, 256))[0] for c in range(3)]
        assert sums[m, i, j] == pytest.approx(np.sum(counts * weights[m]), abs=2e-3)


def test_windows_may_be_anywhere() -> None:
    tables = weights_of(16, 2)[0].tables
    grid = table_sums(STRIP, tables, 32, X, Y)
    listed = table_sums(STRIP, tables, 32, np.array([38, 0]), np.array([7, 8]))
    np.testing.assert_array_equal(listed, [[m[2, 2], m[0, 3]] for m in grid])


def test_without_a_histogram_nothing_is_added() -> None:
    tables = weights_of(0, 2)[0].tables
    assert not table_sums(STRIP, tables, 32, X, Y).any()
