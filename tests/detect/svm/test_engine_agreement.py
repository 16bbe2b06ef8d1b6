"""The dense and the patch engine give nearly the same results for the same windows."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from benchmarks.patch_search import PatchSearch

from detect.svm.engine_comparison import (
    SEED_FEATURES,
    EngineResults,
    cars,
    compare,
    fitted,
    grid_of,
    road,
    with_boxes,
)
from seed import SEED
from vdet.boxes import Image, from_sizes, iou_matrix
from vdet.config.detector import FeatureSettings, HistogramSettings, HogSettings, SearchSettings
from vdet.config.schema import SvmSettings
from vdet.detect.svm.dense_search import DenseSearch
from vdet.detect.svm.horizon import find_horizon
from vdet.detect.svm.kind import shipped_model
from vdet.detect.svm.model import LinearModel, load_model
from vdet.detect.svm.search import Engine, FrameSearch
from vdet.detect.svm.windows import WindowGrid, Windows, lay_grids
from vdet.media import Picture, Planes
from vdet.media.frame import Coding

SHIPPED = {"seed": SEED.svm, "default": SvmSettings()}
GRIDS = {
    "a cell": grid_of(64, overlap=0.875),
    "two cells": grid_of(96, overlap=0.75),
    "three cells": grid_of(64, overlap=0.625),
    "one and a half": grid_of(64, overlap=0.8),
    "half pixels": grid_of(128, overlap=0.8),
    "third pixels": grid_of(96, overlap=0.8),
    "enlarged": grid_of(48, overlap=0.8),
    "enlarged, third pixels": grid_of(48, overlap=0.85),
}
FEATURES = {
    "fine histogram": FeatureSettings(histogram=HistogramSettings(bins=256)),
    "12 orientations": FeatureSettings(hog=HogSettings(orientations=12)),
    "large blocks": FeatureSettings(hog=HogSettings(block=3)),
    "single cells": FeatureSettings(hog=HogSettings(block=1)),
    "patch of 48": FeatureSettings(patch=48, hog=HogSettings(cell=6)),
}


STEPS = (12, 18, 19)
"""Steps of windows of 96 pixels: a cell, one and a half, and another distance."""
HORIZON = 0.57
"""Row of the horizon of the drawn road."""

PROBABILITY = 0.5
"""Minimum probability of a hit."""

FEW = 0.92
"""Minimum fraction of equal decisions in a small grid, where a few near 0.5 are some percent."""


def assert_agree(results: EngineResults, correlation: float = 0.99, same: float = 0.97) -> None:
    assert (results.patch > 0).any(), "nothing is found: decisions cannot differ"
    assert results.correlation >= correlation
    assert results.same >= same


@pytest.mark.parametrize(("name", "members"), [("seed", 3), ("default", 1), ("default", 3)])
def test_the_engines_agree_on_a_drawn_road(name: str, members: int) -> None:
    model = fitted(SHIPPED[name].features, members)
    grids = lay_grids(SHIPPED[name], model.features, 1280, 720, horizon=HORIZON)
    assert_agree(compare(model, grids, road()))


@pytest.mark.parametrize("kind", GRIDS)
def test_the_engines_agree_for_any_step(kind: str) -> None:
    model = fitted(SEED_FEATURES, members=2)
    assert_agree(compare(model, [GRIDS[kind]], cars()), same=FEW)


@pytest.mark.parametrize("name", FEATURES)
def test_the_engines_agree_for_any_features(name: str) -> None:
    grids = [grid_of(96, overlap=0.875), grid_of(96, overlap=0.7)]
    model = fitted(FEATURES[name])
    assert_agree(compare(model, grids, cars()), correlation=0.97, same=FEW)


@pytest.mark.parametrize("coding", [Coding(), Coding("bt709")], ids=["BT.601", "BT.709"])
def test_the_engines_agree_on_planes(coding: Coding) -> None:
    model = fitted(FeatureSettings())
    grids = lay_grids(SvmSettings(), model.features, 1280, 720, horizon=HORIZON)
    assert_agree(compare(model, grids, Planes.of_image(road(), coding)), correlation=0.98)


def _a_car_cut_off(side: str) -> Image:
    """Return a picture in which the nearest of the drawn cars is cut off by this side."""
    return cars()[:, 280:440] if side == "left" else cars()[:, 160:320]


@pytest.mark.parametrize(("width", "height"), [(853, 480), (960, 540), (1242, 375), (1920, 1080)])
def test_the_engines_agree_for_the_default_sets_in_frames_of_any_size(
    width: int, height: int
) -> None:
    # In frames of any size, their strips are halved in the same way as the windows.
    model = fitted(FeatureSettings())
    grids = lay_grids(SvmSettings(), model.features, width, height, horizon=HORIZON)
    assert_agree(compare(model, grids, road(width, height)), correlation=0.998)


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_engines_agree_beyond_the_sides_of_the_frame(side: str) -> None:
    grids = [
        WindowGrid(96, Fraction(step), Fraction(-48), Fraction(8), columns=160 // step + 1, rows=5)
        for step in STEPS
    ]
    model = fitted(FeatureSettings())
    assert_agree(compare(model, grids, _a_car_cut_off(side)), same=FEW)


@pytest.fixture(scope="module")
def real_frames(real_data: Path) -> list[Image]:
    """Frames 250, 500 and 750 of the project video, which are key frames."""
    images = []
    with av.open(real_data / "project_video.mp4") as container:
        for second in (10, 20, 30):
            container.seek(second * av.time_base)
            frame = next(container.decode(video=0))
            assert frame.time == second
            images.append(np.asarray(frame.to_ndarray(format="bgr24"), np.uint8))
    return images


@pytest.mark.realdata
@pytest.mark.parametrize("name", SHIPPED)
def test_the_engines_agree_on_the_real_road(name: str, real_frames: list[Image]) -> None:
    settings = SHIPPED[name]
    model = load_model(shipped_model(settings))
    horizon = find_horizon(real_frames)
    assert horizon is not None
    grids = lay_grids(settings, model.features, 1280, 720, horizon=horizon)
    results = [compare(model, grids, image) for image in real_frames]
    dense = np.concatenate([result.dense for result in results])
    patch = np.concatenate([result.patch for result in results])
    assert_agree(EngineResults(dense, patch))


def _vehicles(model: LinearModel, grid: WindowGrid, image: Image, engine: Engine) -> Windows:
    """Search a frame with the windows of one grid."""
    settings = SvmSettings(search=SearchSettings(probability=PROBABILITY))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("vdet.detect.svm.search.lay_grids", lambda *_, **__: [grid])
        height, width = image.shape[:2]
        search = FrameSearch(model, settings, width, height, engine=engine)
        return search.search(Picture(image))


def _vehicles_by_both(model: LinearModel, step: int) -> tuple[Windows, Windows]:
    """Search with a grid that reaches beyond the frame; return the results of dense and patch."""
    left, columns = Fraction(-2 * step), (440 + 4 * step - 96) // step + 1
    grid = WindowGrid(96, Fraction(step), left, Fraction(8), columns, rows=5)
    dense, patch = (_vehicles(model, grid, cars(), engine) for engine in (DenseSearch, PatchSearch))
    hits = [found.probabilities >= PROBABILITY for found in (dense, patch)]
    assert (hits[0] & hits[1]).sum() > 5
    same = hits[0] == hits[1]
    assert same.mean() > FEW
    return _only(dense, same), _only(patch, same)


def _only(windows: Windows, keep: np.ndarray) -> Windows:
    return Windows(
        windows.boxes[keep],
        windows.probabilities[keep],
        windows.shares[keep],
        windows.vehicles[keep],
    )


@pytest.mark.parametrize("step", STEPS)
def test_the_engines_agree_on_the_vehicles_in_hits(step: int) -> None:
    dense, patch = _vehicles_by_both(with_boxes(fitted(FeatureSettings())), step)
    hits = patch.probabilities >= PROBABILITY
    assert (patch.vehicles[hits] != patch.boxes[hits]).any(axis=1).all()
    pair = (from_sizes(found.vehicles) for found in (dense, patch))
    assert np.diag(iou_matrix(*pair)).min() > 0.9
    for found in (dense, patch):
        np.testing.assert_array_equal(found.vehicles[~hits], found.boxes[~hits])
