import numpy as np
import pytest

from vdet.boxes import Float32Array
from vdet.detect.svm.model import BoxRegression
from vdet.learn.svm.box_regression import BoxRows, fit_sides

TRUE = BoxRegression(
    np.random.default_rng(1).normal(size=(4, 12)).astype(np.float32),
    np.array([-0.5, -0.4, 0.5, 0.3], np.float32),
)


def scene(count: int = 400) -> tuple[Float32Array, Float32Array]:
    """Return features of different spread, and the sides that `TRUE` computes from them."""
    rng = np.random.default_rng(0)
    hogs = (rng.random((count, 12)) * np.linspace(0.05, 1, 12)).astype(np.float32)
    return hogs, TRUE.sides(hogs)


def test_a_linear_map_is_found() -> None:
    found = fit_sides([BoxRows(*scene())], penalty=1e-6)
    np.testing.assert_allclose(found.weights, TRUE.weights, atol=0.01)
    np.testing.assert_allclose(found.biases, TRUE.biases, atol=0.01)
    assert found.weights.dtype == found.biases.dtype == np.float32


@pytest.mark.parametrize("column", [0, 3])
def test_each_side_is_fitted_on_its_own_rows_alone(column: int) -> None:
    hogs, sides = scene()
    sides += np.random.default_rng(3).normal(size=sides.shape).astype(np.float32)
    sides[100:200, 0] = sides[:30, 2] = sides[50:80, 3] = np.nan
    together = fit_sides([BoxRows(hogs, sides)], penalty=0.1)
    known = ~np.isnan(sides[:, column])
    alone = np.full((int(known.sum()), 4), np.nan, np.float32)
    alone[:, column] = sides[known, column]
    own = fit_sides([BoxRows(hogs[known], alone)], penalty=0.1)
    np.testing.assert_allclose(together.weights[column], own.weights[column], atol=1e-4)
    np.testing.assert_allclose(together.biases[column], own.biases[column], atol=1e-4)


@pytest.mark.parametrize("count", [400, 8])
def test_the_penalty_is_per_patch_so_that_a_set_given_twice_gives_the_same(count: int) -> None:
    """A set of 8 patches has fewer rows than features; given twice, it has more."""
    hogs, sides = scene(count)
    once = fit_sides([BoxRows(hogs, sides)], penalty=0.5)
    twice = fit_sides([BoxRows(hogs, sides), BoxRows(hogs, sides)], penalty=0.5)
    np.testing.assert_allclose(once.weights, twice.weights, atol=1e-4)


def test_a_row_of_weight_two_counts_as_two() -> None:
    hogs, sides = scene(60)
    sides += np.random.default_rng(3).normal(size=sides.shape).astype(np.float32)
    parts = [BoxRows(hogs[:20], sides[:20], 2.0), BoxRows(hogs[20:], sides[20:])]
    weighted = fit_sides(parts, 1e-6)
    repeated = fit_sides([BoxRows(hogs, sides), BoxRows(hogs[:20], sides[:20])], 1e-6)
    np.testing.assert_allclose(weighted.weights, repeated.weights, atol=2e-2)


def test_a_feature_that_hardly_varies_gets_a_small_weight() -> None:
    hogs, sides = scene()
    hogs[:, 0] = 1 + 1e-4 * np.random.default_rng(4).normal(size=len(hogs))
    assert abs(fit_sides([BoxRows(hogs, sides)], penalty=0.1).weights[:, 0]).max() < 0.1
