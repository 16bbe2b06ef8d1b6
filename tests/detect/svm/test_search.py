"""The dense search: it finds what the search of single patches finds, in planes and in BGR."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codings import in_any_coding
from detect.svm.engine_comparison import (
    SEED_FEATURES,
    EngineResults,
    cars,
    compare,
    fitted,
    grid_of,
    log_odds,
    road,
)
from seed import SEED
from vdet.boxes import Image
from vdet.config.kinds import (
    FeatureSettings,
    HistogramSettings,
    PerspectiveSettings,
    SearchSettings,
    WindowSettings,
)
from vdet.config.schema import SvmSettings
from vdet.config.section import scale_lengths
from vdet.detect.svm.detector import SvmDetector
from vdet.detect.svm.model import BoxRegression, LinearModel, resize, split
from vdet.detect.svm.windows import (
    FramePyramid,
    FrameStrip,
    Windows,
    window_grids,
)
from vdet.errors import FrameSizeError
from vdet.media import Picture, Planes
from vdet.media.frame import Coding

Sides = tuple[float, float, float, float]

COLOUR = FeatureSettings(histogram=HistogramSettings(bins=8))
SMALL = FeatureSettings(patch=16, halved=())
FRAME = np.random.default_rng(0).integers(0, 256, (120, 160, 3), dtype=np.uint8)
SETS = (
    WindowSettings(size=32, overlap=0.75, top=24, bottom=88),
    WindowSettings(size=48, overlap=0.5, top=8, bottom=120),
)


def model_of(features: FeatureSettings) -> LinearModel:
    weights = np.random.default_rng(1).normal(scale=0.02, size=(1, features.length))
    one = np.ones(1, np.float32)
    return LinearModel(features, weights.astype(np.float32), 0 * one, -one, 0 * one)


def search_of(features: FeatureSettings) -> SvmDetector:
    settings = SvmSettings(features=features, search=scale_lengths(fixed(*SETS), 720 / 120))
    return SvmDetector(model_of(features), settings, 160, 120)


def fixed(*sets: WindowSettings) -> SearchSettings:
    """Return settings with these sets and no others."""
    return SearchSettings(windows=sets, perspective=PerspectiveSettings(sizes=()))


def with_sides(sides: Sides) -> SvmDetector:
    """Return a search whose regression gives equal sides for all hits, half of the windows."""
    boxes = BoxRegression(np.zeros((4, SMALL.hog_length), np.float32), np.array(sides, np.float32))
    search = fixed(*SETS).model_copy(update={"probability": MEDIAN})
    settings = SvmSettings(features=SMALL, search=scale_lengths(search, 720 / 120))
    return SvmDetector(replace(model_of(SMALL), box_regression=boxes), settings, 160, 120)


def search_all(search: SvmDetector, image: Image = FRAME) -> Windows:
    return search.search(Picture(image), 0)[0]


MEDIAN = float(np.median(search_all(search_of(SMALL)).probabilities))


def test_the_seed_has_831_windows_on_a_720p_frame_the_large_ones_first() -> None:
    grids = window_grids(SEED.svm, SEED.svm.features, 1280, 720, horizon=0.5)
    sides = [width for grid in grids for width in grid.boxes[:, 2].tolist()]
    assert sides == [128] * 423 + [64] * 408


class TestSearching:
    def test_every_window_of_every_set_has_a_probability_and_its_weight(self) -> None:
        found = search_all(search_of(SMALL))
        # 4 cells across: the first set's step is 8 pixels of 32, the second's 24 of 48
        assert len(found) == 17 * 5 + 5 * 3
        assert found.boxes[0].tolist() == [0, 24, 32, 32]
        assert found.boxes[-1, 2:].tolist() == [48, 48]
        assert found.weights.tolist() == [1 / 16] * (17 * 5) + [1 / 4] * (5 * 3)
        assert found.probabilities.shape == found.weights.shape
        assert found.probabilities.dtype == found.weights.dtype == np.float32
        assert len(np.unique(found.probabilities)) > len(found) / 2


class TestVehicles:
    def test_without_a_regression_vehicles_are_the_windows(self) -> None:
        found = search_all(search_of(SMALL))
        np.testing.assert_array_equal(found.vehicles, found.boxes)
        assert found.vehicles.dtype == np.float32

    def test_the_vehicles_of_hits_are_where_the_regression_puts_them(self) -> None:
        # left, top, right, bottom from the middle, in sides of the window
        found = search_all(with_sides((-0.25, 0, 0.5, 0.375)))
        hits = found.probabilities >= MEDIAN
        assert 10 < hits.sum() < len(found) - 10
        expected = [
            [x + size / 2 - size / 4, y + size / 2, 0.75 * size, 0.375 * size]
            for x, y, size, _ in found.boxes[hits].tolist()
        ]
        np.testing.assert_allclose(found.vehicles[hits], expected, rtol=1e-6)
        np.testing.assert_array_equal(found.vehicles[~hits], found.boxes[~hits])

    @pytest.mark.parametrize("sides", [(0.3, 0.4, 0.1, 0.2), (0.2, 0.3, 0.2, 0.3)])
    def test_vehicles_have_a_least_size_whatever_the_regression_gives(self, sides: Sides) -> None:
        found = search_all(with_sides(sides))
        hits = found.probabilities >= MEDIAN
        x, y, size, _ = found.boxes[hits].T
        np.testing.assert_allclose(found.vehicles[hits][:, 2], 0.2 * size, rtol=1e-6)
        np.testing.assert_allclose(found.vehicles[hits][:, 3], 0.2 * size, rtol=1e-6)
        middle = found.vehicles[hits][:, :2] + found.vehicles[hits][:, 2:] / 2
        np.testing.assert_allclose(middle[:, 0], x + size / 2 + 0.2 * size, rtol=1e-6)
        np.testing.assert_allclose(middle[:, 1], y + size / 2 + 0.3 * size, rtol=1e-6)


@pytest.mark.parametrize(("width", "height"), [(63, 720), (1, 1), (2, 2), (40, 2000)])
def test_a_frame_without_room_for_any_window_is_refused(width: int, height: int) -> None:
    with pytest.raises(FrameSizeError, match=rf"no search window fits .* {width}×{height} pixels"):
        SvmDetector(model_of(COLOUR), SEED.svm, width, height)


HORIZON = 0.57
"""Row of the horizon of the drawn road."""


def both_forms(image: Image, coding: Coding) -> tuple[Picture, Picture]:
    """Return an image as planes, and these as BGR."""
    picture = Picture(Planes.of_image(image, coding))
    return picture, Picture(picture.image)


@in_any_coding
def test_windows_have_about_the_same_probabilities(coding: Coding) -> None:
    search = SvmDetector(fitted(FeatureSettings()), SvmSettings(), 1280, 720, horizon=HORIZON)
    ours, expected = (
        log_odds(search.search(picture, 0)[0].probabilities)
        for picture in both_forms(road(), coding)
    )
    assert (expected > 0).any(), "nothing is found: decisions cannot differ"
    assert np.corrcoef(ours, expected)[0, 1] > 0.97
    assert np.mean((ours > 0) == (expected > 0)) > 0.95


WHOLE = FeatureSettings(halved=())
PICTURE = np.random.default_rng(0).integers(0, 256, (97, 131, 3), dtype=np.uint8)


def spans(length: int) -> st.SearchStrategy[slice]:
    pairs = st.tuples(st.integers(0, length - 1), st.integers(1, length))
    return pairs.map(lambda pair: slice(pair[0], min(length, sum(pair))))


@given(
    st.sampled_from([0, 1, 2, 3, 4, 8, 16]),
    st.sampled_from([0, 1, 2, 3, 4, 8, 16]),
    st.sampled_from([1, 2, 4, 8]),
    st.sampled_from([2, 3, 4]),
)
def test_a_cut_of_halvable_size_is_halved_from_odd_and_even_pixels(
    top: int, left: int, factor: int, side: int
) -> None:
    rows = slice(top, top + factor * side * 2)
    columns = slice(left, left + factor * side * 3)
    cut = FramePyramid(Picture(PICTURE), WHOLE).cut(FrameStrip(rows, columns, side * 3, side * 2))
    means = PICTURE[rows, columns].reshape(side * 2, factor, side * 3, factor, 3).mean(axis=(1, 3))
    expected = np.array(split(means.round().astype(np.uint8), WHOLE), int)
    np.testing.assert_allclose(cut, expected, atol=2 + np.log2(factor) / 2)  # each halving rounds


MARGIN = 48
BEYOND = np.pad(PICTURE, ((0, 0), (MARGIN, MARGIN), (0, 0)), mode="edge")


@given(spans(97), spans(131 + 2 * MARGIN), st.integers(0, 96), st.integers(1, 40))
def test_beyond_the_sides_the_outermost_columns_repeat(
    rows: slice, columns: slice, top: int, side: int
) -> None:
    frame = FramePyramid(Picture(PICTURE), WHOLE, min(top, rows.start), margin=MARGIN)
    expected = BEYOND[rows, columns]
    of_frame = slice(columns.start - MARGIN, columns.stop - MARGIN)
    height, width, _ = expected.shape
    window = frame.cut(FrameStrip(rows, of_frame, width, height))
    np.testing.assert_array_equal(window, split(expected, WHOLE))
    cut = frame.cut(FrameStrip(rows, of_frame, side, side))
    as_in_training = split(resize(expected, side, side), WHOLE)
    np.testing.assert_array_equal(cut, as_in_training)


SHIPPED = {"seed": SEED.svm, "default": SvmSettings()}
PAIRS = {
    "a cell": grid_of(64, overlap=0.875),
    "two cells": grid_of(96, overlap=0.75),
    "three cells": grid_of(64, overlap=0.625),
    "one and a half": grid_of(64, overlap=0.8),
    "half pixels": grid_of(128, overlap=0.8),
    "third pixels": grid_of(96, overlap=0.8),
    "enlarged": grid_of(48, overlap=0.8),
    "enlarged, third pixels": grid_of(48, overlap=0.85),
}
FEW = 0.92
"""Minimum fraction of equal decisions in a small grid, where a few near 0.5 are some percent."""


def assert_agree(results: EngineResults, same: float = 0.97) -> None:
    assert (results.patch > 0).any(), "nothing is found: decisions cannot differ"
    assert results.correlation >= 0.99
    assert results.same >= same
    assert results.sides_apart < 0.15


@pytest.mark.parametrize(("name", "members"), [("seed", 3), ("default", 1), ("default", 3)])
def test_the_engines_agree_on_a_drawn_road(name: str, members: int) -> None:
    model = fitted(SHIPPED[name].features, members)
    grids = window_grids(SHIPPED[name], model.features, 1280, 720, horizon=HORIZON)
    assert_agree(compare(model, grids, road()))


@pytest.mark.parametrize("kind", PAIRS)
def test_the_engines_agree_for_any_step(kind: str) -> None:
    model = fitted(SEED_FEATURES, members=2)
    assert_agree(compare(model, [PAIRS[kind]], cars()), same=FEW)
