"""Strips: where they are cut, their HOG blocks, and the sums over the windows in them."""

from fractions import Fraction

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from detect.svm.engine_comparison import SEED_FEATURES
from vdet.config.svm import FeatureSettings, HistogramSettings, HogSettings
from vdet.detect.svm.features import (
    Channels,
    FeatureExtractor,
    halve,
    split,
    to_patch,
)
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.strips import (
    block_sums,
    describe_blocks,
    histogram_tables,
    table_sums,
    window_blocks,
)
from vdet.detect.svm.windows import WindowGrid
from vdet.media import Picture

FRAME = np.random.default_rng(0).integers(0, 256, (300, 400, 3), dtype=np.uint8)


@pytest.mark.parametrize(
    ("grid", "width", "height"),
    [
        (WindowGrid(64, Fraction(8), Fraction(0), Fraction(0), 10, 3), 64 + 9 * 8, 64 + 2 * 8),
        (WindowGrid(64, Fraction(8), Fraction(5), Fraction(7), 1, 1), 64, 64),
        (WindowGrid(128, Fraction(50), Fraction(25), Fraction(50), 4, 2), 64 + 3 * 25, 64 + 25),
        (WindowGrid(96, Fraction(57), Fraction(19), Fraction(0), 3, 4), 64 + 2 * 38, 64 + 3 * 38),
        (WindowGrid(43, Fraction(43, 8), Fraction(0), Fraction(9), 9, 5), 64 + 8 * 8, 64 + 4 * 8),
    ],
    ids=["a cell", "one window", "half pixels", "third pixels", "an odd size"],
)
def test_a_strip_reaches_from_the_first_window_to_the_last(
    grid: WindowGrid, width: int, height: int
) -> None:
    strip = FramePyramid(Picture(FRAME), SEED_FEATURES).cut(*grid.strip(SEED_FEATURES.patch))
    assert len(strip) == 3
    for channel in strip:
        assert channel.shape == (height, width)
        assert channel.dtype == np.uint8


@pytest.mark.parametrize(("size", "step"), [(64, 8), (64, 12), (128, 16), (128, 50), (32, 12)])
@pytest.mark.parametrize("color_space", ["YCrCb", "HLS"])
def test_the_position_of_a_window_is_scaled_by_patch_over_size(
    size: int, step: int, color_space: str
) -> None:
    features = FeatureSettings.model_validate(
        {"patch": 64, "color_space": color_space, "halved": (), "hog": HogSettings(cell=8)}
    )
    grid = WindowGrid(size, Fraction(step), Fraction(6), Fraction(11), 4, 3)
    strip = FramePyramid(Picture(FRAME), features).cut(*grid.strip(features.patch))
    for i, (x, y, w, h) in enumerate(grid.boxes.tolist()):
        row, column = divmod(i, grid.columns)
        left, top = column * step * 64 // size, row * step * 64 // size
        patch = np.array(split(to_patch(FRAME[y : y + h, x : x + w], 64), features))
        inner = np.s_[:, 1:-1, 1:-1]  # enlarging uses pixels beyond the edge
        ours = np.array(strip)[:, top : top + 64, left : left + 64]
        assert levels_apart(ours[inner], patch[inner], color_space).max() <= 1


def levels_apart(
    ours: npt.NDArray[np.uint8], other: npt.NDArray[np.uint8], color_space: str
) -> npt.NDArray[np.int64]:
    """Return the differences of values; hue, the first channel of HLS, is circular (period 180).

    OpenCV's conversion of a crop and of its frame may differ by one level: vectorised code rounds
    otherwise than the code for the last few pixels of a row.
    """
    apart = abs(ours.astype(np.int64) - other)
    if color_space == "HLS":
        apart[0] = np.minimum(apart[0], 180 - apart[0])
    return apart


def noise(height: int, width: int) -> Channels:
    """Return channels of a colour space, with random values."""
    rng = np.random.default_rng(height)
    first, second, third = rng.integers(0, 256, (3, height, width), dtype=np.uint8)
    return first, second, third


STRIP = noise(96, 160)


@pytest.mark.parametrize(
    ("members", "side", "columns", "rows"),
    [(1, 7, 20, 9), (3, 7, 20, 9), (2, 3, 3, 8), (2, 3, 8, 3), (1, 5, 5, 5), (4, 1, 6, 4)],
)
def test_the_sum_of_a_window_is_that_of_its_weighted_blocks(
    members: int, side: int, columns: int, rows: int
) -> None:
    rng = np.random.default_rng(columns * rows)
    blocks = rng.normal(size=(columns, rows, 6)).astype(np.float32)
    weights = rng.normal(size=(members, side, side, 6)).astype(np.float32)
    places = np.indices((columns - side + 1, rows - side + 1)).reshape(2, -1)
    sums = block_sums(blocks, weights, *places)
    expected = [
        [(blocks[x : x + side, y : y + side] * each).sum() for x, y in places.T] for each in weights
    ]
    np.testing.assert_allclose(sums, expected, atol=1e-4)


def test_a_block_equals_that_of_a_descriptor_around_it() -> None:
    blocks = describe_blocks(STRIP, SEED_FEATURES)
    block = cv2.HOGDescriptor((32, 32), (16, 16), (8, 8), (8, 8), 8)
    for column, row in ((1, 1), (5, 2), (17, 9)):
        x, y = 8 * column - 8, 8 * row - 8
        for number in range(3):
            around = np.ascontiguousarray(STRIP[number][y : y + 32, x : x + 32])
            middle = np.reshape(block.compute(around), (3, 3, 32))[1, 1]
            ours = blocks[column, row, 32 * number : 32 * (number + 1)]
            np.testing.assert_allclose(ours, middle, atol=1e-5)


@pytest.mark.parametrize(
    "features",
    [SEED_FEATURES, FeatureSettings(patch=64, hog=HogSettings(block=3))],
    ids=["seed", "large blocks"],
)
def test_the_blocks_of_a_window_have_the_order_of_the_features(features: FeatureSettings) -> None:
    patch = FRAME[:64, :64]
    extractor = FeatureExtractor(features)
    blocks = describe_blocks(split(patch, features), features)
    origin = np.zeros(1, np.intp)
    (hog,) = window_blocks(blocks, origin, origin, features)
    expected = extractor.describe(patch)[: features.hog_length]
    np.testing.assert_allclose(hog, expected, atol=1e-6)


SMALL_STRIP = noise(40, 70)
X, Y = np.array([0, 3, 38, 38]), np.array([0, 1, 7, 8])


def features_of(bins: int) -> FeatureSettings:
    histogram = HistogramSettings.model_validate({"bins": bins})
    return FeatureSettings(halved=(), histogram=histogram)


def tables_of(features: FeatureSettings, members: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the tables of a model, and the weights of its histogram, `(members, 3, bins)`."""
    bins = features.histogram.bins
    weights = np.random.default_rng(bins).normal(size=(members, features.length)).astype(np.float32)
    model = LinearModel(features, weights, *np.zeros((3, members), np.float32))
    return histogram_tables(model), weights[:, features.hog_length :].reshape(members, 3, bins)


@pytest.mark.parametrize("bins", [8, 32, 256])
@pytest.mark.parametrize("members", [1, 3])
def test_a_window_sums_the_weights_of_its_histogram(bins: int, members: int) -> None:
    features = features_of(bins)
    tables, weights = tables_of(features, members)
    sums = table_sums(SMALL_STRIP, tables, features, X, Y)
    assert sums.shape == (members, 4)
    assert sums.dtype == np.float32
    for m, i in np.ndindex(*sums.shape):
        window = (channel[Y[i] : Y[i] + 32, X[i] : X[i] + 32] for channel in SMALL_STRIP)
        counts = [np.histogram(channel, bins, (0, 256))[0] for channel in window]
        assert sums[m, i] == pytest.approx(np.sum(counts * weights[m]), abs=2e-3)


class TestHalvedChannels:
    """A channel at half size has the blocks and windows of the strip at half their pixels."""

    FEATURES = SEED_FEATURES.model_copy(update={"halved": (1, 2)})

    @staticmethod
    def strip() -> Channels:
        luma, red, blue = STRIP
        return luma, halve(red), halve(blue)

    def test_their_blocks_are_those_of_cells_of_half_the_side(self) -> None:
        ours = describe_blocks(self.strip(), self.FEATURES)
        half = FeatureSettings(patch=32, halved=(), hog=HogSettings(cell=4))
        _, red, blue = self.strip()
        expected = describe_blocks((red, red, blue), half)
        np.testing.assert_array_equal(ours[..., 32:], expected[..., 32:])
        np.testing.assert_array_equal(
            ours[..., :32], describe_blocks(STRIP, SEED_FEATURES)[..., :32]
        )

    def test_a_window_counts_half_its_pixels_across_and_down(self) -> None:
        tables = tables_of(self.FEATURES, 2)[0]
        strip, x, y = self.strip(), np.array([0, 16, 96]), np.array([0, 8, 32])
        none = np.zeros_like(tables)
        for number, channel in enumerate(strip):
            one = none.copy()
            one[:, number] = tables[:, number]
            shrink = 2 if number else 1
            alone = self.FEATURES.model_copy(update={"patch": 64 // shrink, "halved": ()})
            expected = table_sums((channel,) * 3, one, alone, x // shrink, y // shrink)
            np.testing.assert_array_equal(table_sums(strip, one, self.FEATURES, x, y), expected)
