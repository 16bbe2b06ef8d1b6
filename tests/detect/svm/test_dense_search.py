"""The parts of the dense engine; `test_engine_agreement.py` compares it with the naive one."""

from dataclasses import replace
from fractions import Fraction

import cv2
import numpy as np
import pytest

from vdet.boxes import Image
from vdet.config.detector import FeatureSettings, HogSettings
from vdet.detect.svm.features import FeatureExtractor, split
from vdet.detect.svm.model import BoxRegression, LinearModel
from vdet.detect.svm.search import Blocks, DenseSearch, FramePyramid, Gradients, table_sums
from vdet.detect.svm.windows import WINDOW_SIDES, WindowGrid
from vdet.media import Picture

FEATURES = FeatureSettings(patch=64, halved=(), hog=HogSettings(cell=8))
GRIDS = [(64, 8), (64, 16), (64, 12), (128, 24), (128, 25), (80, 13)]
"""Sizes and steps: whole cells, one and a half, and other distances."""


def texture(side: int) -> Image:
    coarse = np.random.default_rng(3).integers(0, 256, (8, 8, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(coarse, (side, side), interpolation=cv2.INTER_CUBIC), np.uint8)


def texture_finder() -> LinearModel:
    """Return a model for which the texture is the most probable vehicle."""
    vector = FeatureExtractor(FEATURES).describe(texture(64))
    vector[FEATURES.hog_length :] = 0
    weights = vector[np.newaxis] / np.linalg.norm(vector) ** 2
    one = np.ones(1, np.float32)
    return LinearModel(FEATURES, weights, biases=-0.7 * one, slopes=-8 * one, offsets=0 * one)


@pytest.mark.parametrize(("size", "step"), GRIDS)
def test_the_sides_in_a_hit_are_those_of_its_hog_features(size: int, step: int) -> None:
    """The regression repeats the model, so the sides of a hit give its decision value."""
    grid = WindowGrid(size, Fraction(step), Fraction(4), Fraction(6), 7, 5)
    model = texture_finder()
    weights = np.repeat(model.weights[:, : FEATURES.hog_length], 4, axis=0)
    regression = BoxRegression(weights, np.repeat(model.biases, 4))
    search = DenseSearch(replace(model, box_regression=regression), grid)
    frame = FramePyramid(Picture(texture(400)), FEATURES)
    minimum = float(np.median(search.search(frame, 1)[0]))
    probabilities, sides = search.search(frame, minimum)
    hits = probabilities >= minimum
    assert sides.shape == (35, 4)
    assert sides.dtype == np.float32
    for side in sides[hits].T:
        expected = model.to_probabilities(side[:, np.newaxis])
        np.testing.assert_allclose(probabilities[hits], expected, atol=1e-5)
    assert len(np.unique(sides[hits].round(4))) > 8
    np.testing.assert_array_equal(sides[~hits], np.tile(WINDOW_SIDES, (17, 1)))


NOISE = np.random.default_rng(0).integers(0, 256, (96, 160, 3), dtype=np.uint8)
HALVED = FEATURES.model_copy(update={"halved": (1, 2)})
X, Y = np.array([0, 16, 40, 96]), np.array([32, 0, 8, 24])


@pytest.mark.parametrize("features", [FEATURES, HALVED], ids=["full", "halved"])
@pytest.mark.parametrize("engine", [Blocks, Gradients])
def test_a_window_has_the_hog_of_its_patch_and_its_weighted_sum(
    engine: type[Blocks | Gradients], features: FeatureSettings
) -> None:
    hog = engine(split(NOISE, features), features)
    vectors = hog.vectors(X, Y)
    assert vectors.shape == (4, features.hog_length)
    for x, y, vector in zip(X, Y, vectors, strict=True):
        # inside a window, gradients do not depend on what is around it
        patch = FeatureExtractor(features).describe(NOISE[y : y + 64, x : x + 64])
        ours, expected = (
            item[: features.hog_length].reshape(3, 7, 7, -1)[:, 1:-1, 1:-1]
            for item in (vector, patch)
        )
        np.testing.assert_allclose(ours, expected, atol=1e-5)
    weights = np.random.default_rng(1).normal(size=(2, features.hog_length)).astype(np.float32)
    np.testing.assert_allclose(hog.values(weights, X, Y), vectors @ weights.T, atol=1e-3)


@pytest.mark.parametrize("features", [FEATURES, HALVED], ids=["full", "halved"])
def test_a_window_sums_the_weights_of_its_histogram(features: FeatureSettings) -> None:
    strip = split(NOISE, features)
    weights = np.random.default_rng(1).normal(size=(2, 3, 32)).astype(np.float32)
    sums = table_sums(strip, np.repeat(weights, 8, axis=2), features, X, Y)
    assert sums.shape == (4, 2)
    assert sums.dtype == np.float32
    for x, y, values in zip(X, Y, sums, strict=True):
        counts = FeatureExtractor(features).describe(NOISE[y : y + 64, x : x + 64])[-96:]
        np.testing.assert_allclose(values, weights.reshape(2, 96) @ counts, atol=1e-2)
