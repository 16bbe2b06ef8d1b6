from dataclasses import replace
from fractions import Fraction
from types import ModuleType

import numpy as np
import pytest
from benchmarks import patch_search
from benchmarks.patch_search import PatchSearch

from detect.svm.engine_comparison import cars, fitted, grid_of, log_odds
from seed import SEED
from vdet.config.schema import FeatureSettings, HistogramSettings, HogSettings
from vdet.detect.svm import dense_search
from vdet.detect.svm.dense_search import LocatedSearch
from vdet.detect.svm.features import FeatureExtractor, Layout, resize, to_patch
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.windows import WindowGrid
from vdet.media import Picture, Planes
from vdet.media.coding import Coding
from vdet.media.images import Image

FRAME = np.random.default_rng(0).integers(0, 256, (120, 160, 3), dtype=np.uint8)
GRID = WindowGrid(63, Fraction(25, 2), Fraction(1), Fraction(2), columns=7, rows=4)
ONE = WindowGrid(64, Fraction(8), Fraction(0), Fraction(0), columns=1, rows=1)
COLOUR = FeatureSettings(hog=HogSettings(channels=()), histogram=HistogramSettings(bins=8))


def model_of(features: FeatureSettings, members: int = 2) -> LinearModel:
    rng = np.random.default_rng(1)
    length = Layout.of(features).length
    weights = rng.normal(scale=1e-2, size=(members, length)).astype(np.float32)
    biases = rng.normal(size=members).astype(np.float32)
    ones = np.ones(members, np.float32)
    return LinearModel(features, weights, biases, -ones, 0 * ones)


def frame_of(
    pixels: Image | Planes = FRAME, features: FeatureSettings = COLOUR, margin: int = 0
) -> FramePyramid:
    return FramePyramid(Picture(pixels), features, margin=margin)


@pytest.mark.parametrize(
    "features",
    [SEED.svm.features, FeatureSettings(), COLOUR, FeatureSettings(patch=16, color_space="HSV")],
    ids=["seed", "default", "colour only", "smaller patch"],
)
def test_every_window_is_cropped_resized_described_and_classified(
    features: FeatureSettings,
) -> None:
    model, extractor = model_of(features), FeatureExtractor(features)
    found = PatchSearch(model, GRID).search(frame_of(FRAME, features)).probabilities
    assert len(found) == 28
    for (x, y, w, h), probability in zip(GRID.boxes.tolist(), found, strict=True):
        crop = to_patch(FRAME[y : y + h, x : x + w], features.patch)
        expected = model.probabilities(extractor.describe(crop)[np.newaxis])[0]
        assert probability == pytest.approx(expected, abs=1e-6)


def test_each_channel_of_planes_is_cropped_and_resized() -> None:
    features = FeatureSettings(halved=())
    model, extractor = model_of(features), FeatureExtractor(features)
    planes = Planes.of_image(FRAME, Coding(full_range=True))
    red, blue = (each.repeat(2, 0).repeat(2, 1) for each in (planes.red, planes.blue))
    found = PatchSearch(model, GRID).search(frame_of(planes, features)).probabilities
    for (x, y, w, h), probability in zip(GRID.boxes.tolist(), found, strict=True):
        first, second, third = (
            resize(channel[y : y + h, x : x + w], features.patch, features.patch)
            for channel in (planes.luma, red, blue)
        )
        vector = extractor.describe_channels((first, second, third))
        expected = model.probabilities(vector[np.newaxis])[0]
        assert probability == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("coding", [Coding(), Coding("bt709")], ids=["BT.601", "BT.709"])
@pytest.mark.parametrize(
    "features", [SEED.svm.features, FeatureSettings()], ids=["seed", "default"]
)
def test_a_window_of_planes_is_seen_about_as_a_patch_of_bgr_is_in_training(
    features: FeatureSettings, coding: Coding
) -> None:
    picture, grid = Picture(Planes.of_image(cars(), coding)), grid_of(96, step=1)
    model, extractor = fitted(features), FeatureExtractor(features)
    found = PatchSearch(model, grid).search(FramePyramid(picture, features)).probabilities
    crops = (picture.image[y : y + h, x : x + w] for x, y, w, h in grid.boxes.tolist())
    vectors = extractor.describe_all(to_patch(crop, features.patch) for crop in crops)
    expected = log_odds(model.probabilities(vectors))
    assert expected.std() > 0.5
    assert np.corrcoef(log_odds(found), expected)[0, 1] > 0.97


def test_probabilities_differ_from_window_to_window() -> None:
    found = PatchSearch(model_of(COLOUR), GRID).search(frame_of()).probabilities
    assert found.shape == (28,)
    assert found.dtype == np.float32
    assert len(np.unique(found)) == 28


def test_a_search_does_not_change_the_frame_or_later_searches() -> None:
    engine, frame = PatchSearch(model_of(COLOUR), GRID), FRAME.copy()
    first = engine.search(frame_of(frame)).probabilities
    engine.search(frame_of(255 - frame))
    np.testing.assert_array_equal(frame, FRAME)
    np.testing.assert_array_equal(engine.search(frame_of(frame)).probabilities, first)


@pytest.mark.parametrize(
    ("engine", "module"), [(PatchSearch, patch_search), (LocatedSearch, dense_search)]
)
def test_the_size_of_a_batch_does_not_matter(
    engine: type[PatchSearch | LocatedSearch],
    module: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    search, frame = engine(model_of(FeatureSettings()), GRID), frame_of(FRAME, FeatureSettings())
    together = search.search(frame).probabilities
    monkeypatch.setattr(module, "BATCH", 3)
    np.testing.assert_allclose(search.search(frame).probabilities, together, atol=1e-6)


def test_what_lies_outside_a_window_does_not_matter() -> None:
    other = np.zeros_like(FRAME)
    other[0:64, 0:64] = FRAME[0:64, 0:64]
    features = SEED.svm.features
    engine = PatchSearch(model_of(features), ONE)
    one, two = (engine.search(frame_of(image, features)).probabilities for image in (FRAME, other))
    assert one == two


def test_the_hog_features_of_some_windows_come_without_the_others() -> None:
    features = FeatureSettings(patch=16)
    model, extractor = model_of(features), FeatureExtractor(features)
    numbers = np.array([27, 3, 3])
    hogs = PatchSearch(model, GRID).search(frame_of(FRAME, features)).hogs(numbers)
    assert hogs.shape == (3, extractor.layout.hog_length)
    for (x, y, w, h), hog in zip(GRID.boxes[numbers].tolist(), hogs, strict=True):
        vector = extractor.describe(to_patch(FRAME[y : y + h, x : x + w], 16))
        np.testing.assert_array_equal(hog, vector[: len(hog)])


def test_a_window_beyond_the_side_sees_the_outermost_columns_repeated() -> None:
    features = FeatureSettings(patch=16)
    model = model_of(features)
    beyond = WindowGrid(32, Fraction(8), Fraction(-16), Fraction(8), columns=19, rows=2)
    inside = replace(beyond, left=Fraction(0))
    padded = np.pad(FRAME, ((0, 0), (16, 16), (0, 0)), mode="edge")
    ours = PatchSearch(model, beyond).search(frame_of(FRAME, features, margin=16))
    expected = PatchSearch(model, inside).search(frame_of(padded, features))
    np.testing.assert_array_equal(ours.probabilities, expected.probabilities)
