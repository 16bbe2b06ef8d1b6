"""When the dense engine searches, and what does where it cannot."""

import logging

import numpy as np
import pytest

from vdet.config.schema import (
    FeatureSettings,
    HistogramSettings,
    HogSettings,
    SearchSettings,
    SpatialSettings,
    SvmSettings,
    WindowSettings,
)
from vdet.detect.svm.dense import why_not_dense
from vdet.detect.svm.features import FeatureExtractor
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.patch_search import PatchSearch
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.search import FrameSearch, lay_grids
from vdet.errors import ConfigError

SPATIAL = FeatureSettings(spatial=SpatialSettings(size=4))
NO_HOG = FeatureSettings(hog=HogSettings(channels=()))
FRAME = np.random.default_rng(0).integers(0, 256, (90, 160, 3), dtype=np.uint8)
REASONS = {"features.spatial": SPATIAL, "features without HOG": NO_HOG}


def model_of(features: FeatureSettings) -> LinearModel:
    length = FeatureExtractor(features).layout.length
    weights = np.random.default_rng(1).normal(scale=0.01, size=(1, length)).astype(np.float32)
    zero, one = np.zeros(1, np.float32), np.ones(1, np.float32)
    return LinearModel(features, weights, zero, -one, zero)


def settings(engine: str) -> SvmSettings:
    search = SearchSettings.model_validate(
        {
            "engine": engine,
            "windows": [WindowSettings(size=32, step=1, top=20, bottom=80)],
            "perspective": {"sizes": []},
        }
    )
    return SvmSettings(reference_height=90, search=search)


def searched(features: FeatureSettings, engine: str) -> np.ndarray:
    (windows,) = FrameSearch(model_of(features), settings(engine), 160, 90).search(FRAME)
    return windows.probabilities


def by_patch(features: FeatureSettings) -> np.ndarray:
    model = model_of(features)
    (grid,) = lay_grids(settings("patch"), features, 160, 90)
    return PatchSearch(model, grid).search(FramePyramid(FRAME)).probabilities


@pytest.fixture(autouse=True)
def log(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logging.getLogger("vdet"), "propagate", True)  # the program stops it
    caplog.set_level(logging.INFO, logger="vdet")


@pytest.mark.parametrize("reason", REASONS)
def test_features_that_cannot_be_dense_are_searched_by_patch_with_one_line(
    reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    features = REASONS[reason]
    np.testing.assert_array_equal(searched(features, "auto"), by_patch(features))
    (record,) = caplog.records
    assert record.levelno == logging.INFO
    assert record.getMessage() == (
        f"the patch engine searches: the dense one cannot compute {reason}"
    )


@pytest.mark.parametrize("reason", REASONS)
def test_the_dense_engine_asked_for_with_them_is_refused(reason: str) -> None:
    message = f"^search.engine: dense cannot compute {reason}; take auto or patch$"
    with pytest.raises(ConfigError, match=message):
        searched(REASONS[reason], "dense")


@pytest.mark.parametrize("features", [FeatureSettings(), SPATIAL, NO_HOG])
def test_the_patch_engine_asked_for_searches_without_a_word(
    features: FeatureSettings, caplog: pytest.LogCaptureFixture
) -> None:
    np.testing.assert_array_equal(searched(features, "patch"), by_patch(features))
    assert caplog.records == []


@pytest.mark.parametrize("engine", ["auto", "dense"])
def test_all_else_is_searched_densely_without_a_word(
    engine: str, caplog: pytest.LogCaptureFixture
) -> None:
    dense = searched(FeatureSettings(), engine)
    assert np.corrcoef(dense, by_patch(FeatureSettings()))[0, 1] > 0.5
    assert (dense != by_patch(FeatureSettings())).any()  # at the edges of patches
    assert caplog.records == []


def test_what_is_dense_by_its_features() -> None:
    assert why_not_dense(FeatureSettings()) is None
    assert why_not_dense(FeatureSettings(histogram=HistogramSettings(bins=0))) is None
    assert why_not_dense(SPATIAL) == "features.spatial"
    assert why_not_dense(NO_HOG) == "features without HOG"
