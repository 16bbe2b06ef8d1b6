import cv2
import numpy as np
import pytest

from detect.svm.dense.reference import SEED_FEATURES
from vdet.config.schema import FeatureSettings, HogSettings
from vdet.detect.svm.dense.hog import channel_of, describe_blocks, window_blocks, window_sums
from vdet.detect.svm.features import FeatureExtractor, convert

RNG = np.random.default_rng(0)
STRIP = RNG.integers(0, 256, (96, 160, 3), dtype=np.uint8)


@pytest.mark.parametrize(
    ("members", "side", "columns", "rows"),
    [(1, 7, 20, 9), (3, 7, 20, 9), (2, 3, 3, 8), (2, 3, 8, 3), (1, 5, 5, 5), (4, 1, 6, 4)],
)
def test_a_window_sums_its_blocks_each_times_its_weights(
    members: int, side: int, columns: int, rows: int
) -> None:
    rng = np.random.default_rng(columns * rows)
    blocks = rng.normal(size=(columns, rows, 6)).astype(np.float32)
    weights = rng.normal(size=(members, side, side, 6)).astype(np.float32)
    sums = window_sums(blocks, weights)
    assert sums.shape == (members, columns - side + 1, rows - side + 1)
    for m, x, y in np.ndindex(*sums.shape):
        expected = (blocks[x : x + side, y : y + side] * weights[m]).sum()
        assert sums[m, x, y] == pytest.approx(expected, abs=1e-4)


def test_every_block_of_a_strip_is_described_once() -> None:
    assert describe_blocks(STRIP, SEED_FEATURES).shape == (19, 11, 3 * 4 * 8)
    large = FeatureSettings(hog=HogSettings(cell=8, block=3, orientations=9, channels=(1,)))
    assert describe_blocks(STRIP, large).shape == (18, 10, 9 * 9)


def test_a_block_is_what_the_descriptor_gives_for_its_pixels_and_their_neighbours() -> None:
    blocks = describe_blocks(STRIP, SEED_FEATURES)
    block = cv2.HOGDescriptor((32, 32), (16, 16), (8, 8), (8, 8), 8)
    for column, row in ((1, 1), (5, 2), (17, 9)):
        x, y = 8 * column - 8, 8 * row - 8
        for number in range(3):
            around = np.ascontiguousarray(STRIP[y : y + 32, x : x + 32, number])
            middle = np.reshape(block.compute(around), (3, 3, 32))[1, 1]
            ours = blocks[column, row, 32 * number : 32 * (number + 1)]
            np.testing.assert_allclose(ours, middle, atol=1e-5)


def test_channels_are_described_in_the_order_of_the_settings() -> None:
    every = describe_blocks(STRIP, SEED_FEATURES)
    settings = FeatureSettings(hog=HogSettings(cell=8, channels=(2, 0)))
    some = describe_blocks(STRIP, settings)
    np.testing.assert_array_equal(some, np.concatenate([every[..., 64:], every[..., :32]], axis=-1))


@pytest.mark.parametrize(
    "features",
    [SEED_FEATURES, FeatureSettings(patch=64, hog=HogSettings(block=3, channels=(2, 0)))],
    ids=["seed", "large blocks"],
)
def test_the_blocks_of_a_window_in_the_order_of_the_features(features: FeatureSettings) -> None:
    patch = STRIP[:64, :64]
    extractor = FeatureExtractor(features)
    blocks = describe_blocks(convert(patch, features), features)
    origin = np.zeros(1, np.intp)
    (hog,) = window_blocks(blocks, origin, origin, features)
    expected = extractor.describe(patch)[: extractor.layout.hog_length]
    np.testing.assert_allclose(hog, expected, atol=1e-6)


def test_windows_are_at_their_block_positions() -> None:
    blocks = describe_blocks(STRIP, SEED_FEATURES)
    columns, rows = np.array([0, 12, 5]), np.array([4, 0, 2])
    windows = window_blocks(blocks, columns, rows, SEED_FEATURES)
    for column, row, window in zip(columns, rows, windows, strict=True):
        cut = blocks[column : column + 7, row : row + 7]
        zero = np.zeros(1, np.intp)
        np.testing.assert_array_equal(window, window_blocks(cut, zero, zero, SEED_FEATURES)[0])


def test_a_channel_is_contiguous() -> None:
    channel = channel_of(STRIP, 1)
    assert channel.flags.c_contiguous
    np.testing.assert_array_equal(channel, STRIP[:, :, 1])
