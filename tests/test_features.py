from typing import get_args

import cv2
import numpy as np
import pytest

from vdet.config.schema import (
    ColorSpace,
    FeatureSettings,
    HistogramSettings,
    HogSettings,
    SpatialSettings,
)
from vdet.features import FeatureExtractor, convert, histogram, to_patch

PATCH = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
NO_HOG = HogSettings(channels=())
NO_HISTOGRAM = HistogramSettings(bins=0)


def test_a_vector_of_the_seed_settings_has_4800_features() -> None:
    extractor = FeatureExtractor(FeatureSettings())
    assert extractor.hog_length == 1568
    assert extractor.length == 3 * 1568 + 96 == 4800
    assert extractor.describe(PATCH).shape == (4800,)
    assert extractor.describe(PATCH).dtype == np.float32


def test_the_hog_part_is_what_opencv_gives_for_each_channel_of_ycrcb() -> None:
    descriptor = cv2.HOGDescriptor((64, 64), (16, 16), (8, 8), (8, 8), 8)
    channels = cv2.split(cv2.cvtColor(PATCH, cv2.COLOR_BGR2YCrCb))
    expected = np.concatenate([np.ravel(descriptor.compute(channel)) for channel in channels])
    np.testing.assert_array_equal(
        FeatureExtractor(FeatureSettings()).describe(PATCH)[:4704], expected
    )


def test_the_histogram_part_is_what_numpy_gives_for_each_channel_of_ycrcb() -> None:
    channels = cv2.split(cv2.cvtColor(PATCH, cv2.COLOR_BGR2YCrCb))
    expected = np.concatenate([np.histogram(c, 32, range=(0, 256))[0] for c in channels])
    np.testing.assert_array_equal(
        FeatureExtractor(FeatureSettings()).describe(PATCH)[4704:], expected
    )


@pytest.mark.parametrize("bins", [8, 16, 32, 64, 128, 256])
def test_a_histogram_counts_every_value_once(bins: int) -> None:
    channel = np.repeat(np.arange(256, dtype=np.uint8), 2).reshape(16, 32)
    assert histogram(channel, bins).tolist() == [2 * 256 // bins] * bins


def test_a_histogram_of_one_colour_has_all_its_bins() -> None:
    assert histogram(np.full((4, 4), 255, np.uint8), 32).tolist() == [0] * 31 + [16]


@pytest.mark.parametrize("space", get_args(ColorSpace))
def test_every_colour_space_is_that_of_opencv(space: ColorSpace) -> None:
    settings = FeatureSettings(color_space=space, hog=NO_HOG, spatial=SpatialSettings(size=64))
    converted = cv2.cvtColor(PATCH, getattr(cv2, f"COLOR_BGR2{space}"))
    np.testing.assert_array_equal(convert(PATCH, settings), converted)
    spatial = FeatureExtractor(settings).describe(PATCH)[96:]
    np.testing.assert_array_equal(spatial.reshape(3, 64, 64), converted.transpose(2, 0, 1))


def test_a_red_patch_is_red_in_rgb() -> None:
    red = np.zeros((64, 64, 3), np.uint8)
    red[..., 2] = 200
    settings = FeatureSettings(color_space="RGB", hog=NO_HOG, histogram=HistogramSettings(bins=8))
    vector = FeatureExtractor(settings).describe(red).reshape(3, 8)
    assert vector.argmax(axis=1).tolist() == [6, 0, 0]


@pytest.mark.parametrize("channels", [(0,), (2, 0), (1, 2)])
def test_hog_may_be_of_some_channels_in_any_order(channels: tuple[int, ...]) -> None:
    some = HogSettings.model_validate({"channels": channels})
    extractor = FeatureExtractor(FeatureSettings(hog=some, histogram=NO_HISTOGRAM))
    everything = FeatureExtractor(FeatureSettings()).describe(PATCH)[:4704].reshape(3, 1568)
    assert extractor.length == 1568 * len(channels)
    np.testing.assert_array_equal(
        extractor.describe(PATCH).reshape(-1, 1568), everything[list(channels)]
    )


def test_without_hog_only_the_histogram_is_left() -> None:
    extractor = FeatureExtractor(FeatureSettings(hog=NO_HOG))
    assert extractor.hog_length == 0
    assert extractor.length == 96
    assert extractor.describe(PATCH).sum() == 3 * 64 * 64


@pytest.mark.parametrize("patch", [17, 20, 100])
def test_without_hog_a_patch_need_not_be_a_multiple_of_the_cell(patch: int) -> None:
    settings = FeatureSettings(patch=patch, hog=NO_HOG)
    assert FeatureExtractor(settings).describe(to_patch(PATCH, patch)).sum() == 3 * patch**2


def test_spatial_features_are_the_shrunk_channels() -> None:
    settings = FeatureSettings(
        hog=NO_HOG, histogram=NO_HISTOGRAM, spatial=SpatialSettings(size=16), color_space="RGB"
    )
    extractor = FeatureExtractor(settings)
    assert extractor.length == 768
    means = PATCH[..., ::-1].reshape(16, 4, 16, 4, 3).mean(axis=(1, 3)).transpose(2, 0, 1)
    np.testing.assert_allclose(extractor.describe(PATCH).reshape(3, 16, 16), means, atol=0.5)


def test_spatial_features_come_last() -> None:
    settings = FeatureSettings(spatial=SpatialSettings(size=8))
    vector = FeatureExtractor(settings).describe(PATCH)
    np.testing.assert_array_equal(
        vector[:4800], FeatureExtractor(FeatureSettings()).describe(PATCH)
    )
    assert len(vector) == 4800 + 192


def test_describe_all_stacks_the_vectors_of_the_patches() -> None:
    extractor = FeatureExtractor(FeatureSettings())
    patches = [PATCH, PATCH[::-1].copy(), PATCH[:, ::-1].copy()]
    vectors = extractor.describe_all(patches)
    assert vectors.dtype == np.float32
    np.testing.assert_array_equal(vectors, [extractor.describe(patch) for patch in patches])


def test_describe_all_of_nothing_has_no_rows() -> None:
    vectors = FeatureExtractor(FeatureSettings()).describe_all([])
    assert vectors.shape == (0, 4800)
    assert vectors.dtype == np.float32


def test_a_patch_of_the_right_size_is_taken_as_it_is() -> None:
    np.testing.assert_array_equal(to_patch(PATCH, 64), PATCH)


def test_another_size_is_resized_bilinearly() -> None:
    expected = cv2.resize(PATCH, (32, 32), interpolation=cv2.INTER_LINEAR)
    np.testing.assert_array_equal(to_patch(PATCH, 32), expected)
    assert to_patch(PATCH[:10, :50], 64).shape == (64, 64, 3)
