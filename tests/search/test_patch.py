import cv2
import numpy as np
import pytest

from vdet.config.schema import FeatureSettings, HistogramSettings, HogSettings
from vdet.features import FeatureExtractor
from vdet.model import LinearModel
from vdet.search.patch import PatchSearch

FRAME = np.random.default_rng(0).integers(0, 256, (120, 160, 3), dtype=np.uint8)
BOXES = np.array(
    [[0, 0, 64, 64], [96, 56, 64, 64], [10, 20, 100, 100], [30, 40, 16, 16], [5, 7, 63, 65]],
    np.int32,
)
COLOUR = FeatureSettings(hog=HogSettings(channels=()), histogram=HistogramSettings(bins=8))


def model_of(features: FeatureSettings, members: int = 2) -> LinearModel:
    rng = np.random.default_rng(1)
    length = FeatureExtractor(features).length
    weights = rng.normal(scale=1e-2, size=(members, length)).astype(np.float32)
    biases = rng.normal(size=members).astype(np.float32)
    ones = np.ones(members, np.float32)
    return LinearModel(features, weights, biases, -ones, 0 * ones)


@pytest.mark.parametrize(
    "features",
    [FeatureSettings(), COLOUR, FeatureSettings(patch=32, color_space="HSV")],
    ids=["seed", "colour only", "smaller patch"],
)
def test_every_window_is_cropped_resized_described_and_scored(features: FeatureSettings) -> None:
    model, extractor = model_of(features), FeatureExtractor(features)
    found = PatchSearch(model, BOXES).search(FRAME)
    side = (features.patch, features.patch)
    for (x, y, w, h), probability in zip(BOXES, found.probabilities, strict=True):
        patch = cv2.resize(FRAME[y : y + h, x : x + w], side, interpolation=cv2.INTER_LINEAR)
        vector = extractor.describe(np.asarray(patch, np.uint8))
        expected = model.probabilities(vector[np.newaxis])[0]
        assert probability == pytest.approx(expected, abs=1e-6)


def test_the_windows_are_given_back_in_order_with_probabilities() -> None:
    found = PatchSearch(model_of(COLOUR), BOXES).search(FRAME)
    np.testing.assert_array_equal(found.boxes, BOXES)
    assert found.probabilities.shape == (5,)
    assert found.probabilities.dtype == np.float32
    assert len(np.unique(found.probabilities)) == 5


def test_a_search_leaves_the_frame_as_it_was_and_remembers_nothing() -> None:
    engine, frame = PatchSearch(model_of(COLOUR), BOXES), FRAME.copy()
    first = engine.search(frame)
    engine.search(255 - frame)
    np.testing.assert_array_equal(frame, FRAME)
    np.testing.assert_array_equal(engine.search(frame).probabilities, first.probabilities)


def test_what_lies_outside_a_window_does_not_matter() -> None:
    other = np.zeros_like(FRAME)
    other[0:64, 0:64] = FRAME[0:64, 0:64]
    engine = PatchSearch(model_of(FeatureSettings()), BOXES[:1])
    assert engine.search(FRAME).probabilities == engine.search(other).probabilities
