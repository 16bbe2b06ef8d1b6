import logging
from typing import Literal

import numpy as np
import pytest

from seed import SEED
from vdet.config.schema import (
    FeatureSettings,
    HistogramSettings,
    HogSettings,
    SearchSettings,
    Settings,
    SpatialSettings,
    WindowSettings,
)
from vdet.errors import ConfigError, ImageError
from vdet.features import Layout
from vdet.model import LinearModel
from vdet.search.engine import FrameSearch, lay_grids
from vdet.windows import Boxes

COLOUR = FeatureSettings(hog=HogSettings(channels=()), histogram=HistogramSettings(bins=8))
SMALL = FeatureSettings(patch=16, hog=HogSettings(channels=(0,)))
FRAME = np.random.default_rng(0).integers(0, 256, (120, 160, 3), dtype=np.uint8)
SETS = (
    WindowSettings(size=32, step=1, top=24, bottom=88),
    WindowSettings(size=48, overlap=0.5, top=8, bottom=120),
)


def model_of(features: FeatureSettings) -> LinearModel:
    weights = np.random.default_rng(1).normal(scale=0.02, size=(1, Layout.of(features).length))
    one = np.ones(1, np.float32)
    return LinearModel(features, weights.astype(np.float32), 0 * one, -one, 0 * one)


def laid(width: int, height: int, settings: Settings = SEED) -> Boxes:
    grids = lay_grids(settings, settings.features, width, height)
    return np.concatenate([grid.boxes for grid in grids])


def search_of(
    features: FeatureSettings, engine: Literal["auto", "dense", "patch"] = "auto"
) -> FrameSearch:
    search = SearchSettings(engine=engine, windows=SETS)
    settings = Settings(reference_height=120, features=features, search=search)
    return FrameSearch(model_of(features), settings, 160, 120)


def band(size: int, top: int, bottom: int) -> WindowSettings:
    return WindowSettings(size=size, overlap=0.5, top=top, bottom=bottom)


class TestLayingGrids:
    def test_the_seed_has_831_windows_on_a_720p_frame_the_large_ones_first(self) -> None:
        assert laid(1280, 720)[:, 2].tolist() == [128] * 423 + [64] * 408

    def test_all_default_sets_find_room_on_a_720p_frame(self) -> None:
        settings = Settings()
        grids = lay_grids(settings, settings.features, 1280, 720)
        assert [grid.size for grid in grids] == [each.size for each in settings.search.windows]

    @pytest.mark.parametrize(
        ("width", "height"), [(640, 360), (1920, 1080), (1279, 721), (853, 480)]
    )
    def test_the_sets_scale_with_the_rows_of_the_frame(self, width: int, height: int) -> None:
        large, small = lay_grids(SEED, SEED.features, width, height)
        factor = height / 720
        assert large.boxes[0].tolist() == [0, *[int(n * factor + 0.5) for n in (380, 128, 128)]]
        assert small.boxes[0].tolist() == [0, *[int(n * factor + 0.5) for n in (400, 64, 64)]]

    @pytest.mark.parametrize("settings", [SEED, Settings()], ids=["seed", "default"])
    @pytest.mark.parametrize(
        ("width", "height"), [(1280, 720), (1277, 719), (1281, 721), (129, 720), (333, 77)]
    )
    def test_all_windows_lie_inside_the_frame(
        self, settings: Settings, width: int, height: int
    ) -> None:
        x, y, w, h = laid(width, height, settings).T
        assert (x >= 0).all()
        assert (y >= 0).all()
        assert (x + w <= width).all()
        assert (y + h <= height).all()

    def test_steps_are_counted_in_cells_of_the_features(self) -> None:
        sets = SearchSettings(windows=(WindowSettings(size=64, step=1, top=0, bottom=64),))
        settings = Settings(search=sets)
        for cell, step in ((4, 8), (8, 16)):
            features = FeatureSettings(patch=32, hog=HogSettings(cell=cell))
            (grid,) = lay_grids(settings, features, 1280, 720)
            assert grid.step == step

    def test_windows_below_the_frame_are_left_out(self) -> None:
        sets = SearchSettings(windows=(band(64, 600, 900), band(64, 700, 800)))
        (grid,) = lay_grids(Settings(search=sets), COLOUR, 640, 720)
        assert {y for _, y, _, _ in grid.boxes.tolist()} == {600, 632}

    def test_a_set_that_does_not_fit_leaves_the_others(self) -> None:
        # the large windows are wider than the frame, the small ones are not
        assert [grid.size for grid in lay_grids(SEED, COLOUR, 100, 720)] == [64]

    def test_no_window_is_ever_smaller_than_a_pixel(self) -> None:
        settings = SEED.model_copy(update={"reference_height": 100_000})
        assert lay_grids(settings, COLOUR, 400, 300) == []


class TestSearching:
    @pytest.mark.parametrize("engine", ["dense", "patch"])
    def test_every_window_of_every_set_has_a_probability_and_its_share(
        self, engine: Literal["dense", "patch"]
    ) -> None:
        found = search_of(SMALL, engine).search(FRAME)
        # 4 cells across: the first set's step is 8 pixels of 32, the second's 24 of 48
        assert len(found) == 17 * 5 + 5 * 3
        assert found.boxes[0].tolist() == [0, 24, 32, 32]
        assert found.boxes[-1, 2:].tolist() == [48, 48]
        assert found.shares.tolist() == [1 / 16] * (17 * 5) + [1 / 4] * (5 * 3)
        assert found.probabilities.shape == found.shares.shape
        assert found.probabilities.dtype == found.shares.dtype == np.float32
        assert len(np.unique(found.probabilities)) > len(found) / 2

    def test_the_engines_agree(self) -> None:
        dense = search_of(SMALL, "dense").search(FRAME)
        patch = search_of(SMALL, "patch").search(FRAME)
        np.testing.assert_array_equal(dense.boxes, patch.boxes)
        assert np.corrcoef(dense.probabilities, patch.probabilities)[0, 1] > 0.9

    def test_nothing_outside_the_search_rows_matters(self) -> None:
        search = search_of(SMALL)
        other = FRAME.copy()
        other[:8] = 0
        np.testing.assert_array_equal(
            search.search(other).probabilities, search.search(FRAME).probabilities
        )

    def test_a_search_leaves_the_frame_as_it_was_and_remembers_nothing(self) -> None:
        search, frame = search_of(SMALL), FRAME.copy()
        first = search.search(frame)
        search.search(255 - frame)
        np.testing.assert_array_equal(frame, FRAME)
        np.testing.assert_array_equal(search.search(frame).probabilities, first.probabilities)


class TestTheChoiceOfAnEngine:
    def test_auto_takes_the_dense_one_where_it_can(self) -> None:
        auto, dense = (search_of(SMALL, engine).search(FRAME) for engine in ("auto", "dense"))
        np.testing.assert_array_equal(auto.probabilities, dense.probabilities)

    @pytest.mark.parametrize(
        ("features", "missing"),
        [
            (COLOUR, "features without HOG"),
            (SMALL.model_copy(update={"spatial": SpatialSettings(size=4)}), "features.spatial"),
        ],
        ids=["colour only", "spatial"],
    )
    def test_what_the_dense_one_cannot_compute_goes_to_the_other(
        self, features: FeatureSettings, missing: str, caplog: pytest.LogCaptureFixture
    ) -> None:
        with caplog.at_level(logging.INFO, "vdet"):
            auto = search_of(features).search(FRAME)
        assert f"the patch engine searches: the dense one cannot compute {missing}" in caplog.text
        patch = search_of(features, "patch").search(FRAME)
        np.testing.assert_array_equal(auto.probabilities, patch.probabilities)
        with pytest.raises(ConfigError, match=rf"dense cannot compute {missing}; take auto or"):
            search_of(features, "dense")


@pytest.mark.parametrize(("width", "height"), [(63, 720), (1, 1), (2, 2), (40, 2000)])
def test_a_frame_without_room_for_any_window_is_refused(width: int, height: int) -> None:
    with pytest.raises(
        ImageError, match=rf"no search window fits .* {width}×{height} pixels; give"
    ):
        FrameSearch(model_of(COLOUR), SEED, width, height)


def test_a_frame_that_ends_above_the_search_rows_is_refused() -> None:
    settings = Settings(search=SearchSettings(windows=(band(64, 800, 900),)))
    with pytest.raises(ImageError, match="no search window fits"):
        FrameSearch(model_of(COLOUR), settings, 1280, 720)
