"""The sheet of a patch: tiles of equal size, side by side, a row a patch."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

import seed
from vdet.config.svm import HistogramSettings, HogSettings
from vdet.detect.svm.patch_sheet import TILE, patch_sheet
from vdet.media.images import Image

PITCH = (TILE + 32, TILE + 8)  # of tiles with their frames, down and across
SEED = seed.SEED.svm.features
FIRST_HOG = 4


def tile(sheet: Image, number: int) -> Image:
    left = number * PITCH[1] + 4
    return sheet[28 : 28 + TILE, left : left + TILE]


def pattern(bright: Callable[[Any, Any], Any]) -> Image:
    """Draw a patch, bright where `bright` of the rows and columns is true."""
    y, x = np.mgrid[:64, :64]
    gray = np.where(bright(y, x), 220, 30).astype(np.uint8)
    return np.dstack([gray] * 3)


def hog_tile(patch: Image) -> npt.NDArray[np.float64]:
    return tile(patch_sheet({"": patch}, SEED), FIRST_HOG)[:, :, 0].astype(float)


def gradient_sums(strokes: npt.NDArray[np.float64]) -> tuple[float, float, float]:
    """Return the sums of gx², gy² and gx·gy: across which direction the strokes run."""
    gx, gy = cv2.Sobel(strokes, cv2.CV_64F, 1, 0), cv2.Sobel(strokes, cv2.CV_64F, 0, 1)
    return float((gx * gx).sum()), float((gy * gy).sum()), float((gx * gy).sum())


def random_patch() -> Image:
    return np.random.default_rng(3).integers(0, 256, (64, 64, 3), np.uint8)


class TestShape:
    @pytest.mark.parametrize("patches", [1, 2, 3])
    def test_each_patch_has_a_row_of_patch_channels_hog_and_histogram(self, patches: int) -> None:
        sheet = patch_sheet({f"patch {i}": random_patch() for i in range(patches)}, SEED)
        assert sheet.shape == (patches * PITCH[0], 8 * PITCH[1], 3)
        assert sheet.dtype == np.uint8

    @pytest.mark.parametrize(
        ("change", "tiles"),
        [
            ({"hog": HogSettings(channels=())}, 5),
            ({"hog": HogSettings(channels=(1,))}, 6),
            ({"histogram": HistogramSettings(bins=None)}, 7),
        ],
    )
    def test_features_that_are_off_have_no_tile(self, change: dict[str, Any], tiles: int) -> None:
        sheet = patch_sheet({"": random_patch()}, SEED.model_copy(update=change))
        assert sheet.shape[1] == tiles * PITCH[1]


class TestCaptions:
    def test_captions_name_the_patch_its_channels_and_its_features(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        written: list[str] = []
        monkeypatch.setattr(cv2, "putText", lambda _, text, *__: written.append(text))
        patch_sheet({"car": random_patch()}, SEED.model_copy(update={"color_space": "HSV"}))
        assert written == [
            "car", "HSV [0]", "HSV [1]", "HSV [2]", "HOG [0]", "HOG [1]", "HOG [2]",
            "histogram, 32 bins",
        ]  # fmt: skip


class TestChannels:
    def test_the_first_tile_is_the_patch(self) -> None:
        patch = random_patch()
        shown = cv2.resize(tile(patch_sheet({"": patch}, SEED), 0), (64, 64), interpolation=0)
        np.testing.assert_array_equal(shown, patch)


class TestHog:
    def test_a_vertical_edge_is_shown_by_vertical_strokes(self) -> None:
        across, along, _ = gradient_sums(hog_tile(pattern(lambda _, x: x >= 32)))
        assert across > 4 * along > 0

    def test_a_rising_edge_is_shown_by_rising_strokes(self) -> None:
        gxx, gyy, gxy = gradient_sums(hog_tile(pattern(lambda y, x: x + y >= 64)))
        assert gxy > 0.3 * (gxx + gyy) / 2

    def test_a_patch_of_one_colour_has_no_strokes(self) -> None:
        assert not hog_tile(np.full((64, 64, 3), 90, np.uint8)).any()


class TestHistogram:
    def test_bars_are_as_high_as_their_counts(self) -> None:
        patch = np.zeros((64, 64, 3), np.uint8)
        patch[:16] = 255  # a quarter
        settings = SEED.model_copy(update={"color_space": "RGB"})
        band = np.vsplit(tile(patch_sheet({"": patch}, settings), 7)[:, :, 0], 3)[0]
        dark, bright = (band > 100)[:, 0].sum(), (band > 100)[:, -4].sum()
        assert bright / dark == pytest.approx(1 / 3, abs=0.02)
