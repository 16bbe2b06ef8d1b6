"""The parts of the dense engine; `test_engine_agreement.py` compares it with the naive one."""

from dataclasses import replace
from fractions import Fraction

import cv2
import numpy as np
import pytest

from vdet.boxes import Image
from vdet.config.kinds import FeatureSettings, HogSettings
from vdet.detect.svm.model import BoxRegression, FeatureExtractor, LinearModel
from vdet.detect.svm.search import DenseSearch, FramePyramid
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
