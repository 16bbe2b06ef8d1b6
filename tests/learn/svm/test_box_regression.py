import numpy as np
import pytest

from vdet.boxes import Float32Array
from vdet.detect.svm.model import BoxRegression
from vdet.learn.svm.training import fit_sides

TRUE = BoxRegression(
    np.random.default_rng(1).normal(size=(4, 12)).astype(np.float32),
    np.array([-0.5, -0.4, 0.5, 0.3], np.float32),
)


def scene(count: int = 400) -> tuple[Float32Array, Float32Array]:
    """Return features of different spread, and the sides that `TRUE` computes from them."""
    rng = np.random.default_rng(0)
    hogs = (rng.random((count, 12)) * np.linspace(0.05, 1, 12)).astype(np.float32)
    return hogs, TRUE.sides(hogs)


def fit(hogs: Float32Array, sides: Float32Array, penalty: float) -> BoxRegression:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vdet.learn.svm.training.PENALTY", penalty)
        return fit_sides(hogs.copy(), sides)


def test_a_linear_map_is_found() -> None:
    found = fit(*scene(), penalty=1e-6)
    np.testing.assert_allclose(found.weights, TRUE.weights, atol=0.01)
    np.testing.assert_allclose(found.biases, TRUE.biases, atol=0.01)
    assert found.weights.dtype == found.biases.dtype == np.float32


def test_the_rows_in_which_a_side_is_unknown_do_not_count_for_it() -> None:
    hogs, sides = scene()
    sides[100:200, 0] = sides[:30, 2] = sides[50:80, 3] = np.nan
    sides[:, 1] = np.nan
    found = fit(hogs, sides, penalty=1e-6)
    for side in (0, 2, 3):
        np.testing.assert_allclose(found.weights[side], TRUE.weights[side], atol=0.01)
    assert found.sides(hogs)[:, 1].tolist() == [0] * 400


@pytest.mark.parametrize("count", [400, 8])
def test_the_penalty_is_per_patch_so_that_a_set_given_twice_gives_the_same(count: int) -> None:
    """A set of 8 patches has fewer rows than features; given twice, it has more."""
    hogs, sides = scene(count)
    once = fit(hogs, sides, penalty=0.5)
    twice = fit(np.tile(hogs, (2, 1)), np.tile(sides, (2, 1)), penalty=0.5)
    np.testing.assert_allclose(once.weights, twice.weights, atol=1e-4)


def test_a_feature_that_hardly_varies_gets_a_small_weight() -> None:
    hogs, sides = scene()
    hogs[:, 0] = 1 + 1e-4 * np.random.default_rng(4).normal(size=len(hogs))
    assert abs(fit(hogs, sides, penalty=0.1).weights[:, 0]).max() < 0.1
