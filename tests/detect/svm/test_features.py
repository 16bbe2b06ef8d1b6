import cv2
import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from seed import SEED
from vdet.detect.svm.model import FeatureExtractor, cut_window, halve, histogram, resize, split

PATCH = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
FEATURES = SEED.svm.features


def test_a_vector_of_the_seed_is_the_hog_of_opencv_and_the_histogram_of_numpy() -> None:
    descriptor = cv2.HOGDescriptor((64, 64), (16, 16), (8, 8), (8, 8), 8)
    channels = cv2.split(cv2.cvtColor(PATCH, cv2.COLOR_BGR2YCrCb))
    hogs = [np.ravel(descriptor.compute(channel)) for channel in channels]
    counts = [np.histogram(channel, 32, range=(0, 256))[0] for channel in channels]
    vector = FeatureExtractor(FEATURES).describe(PATCH)
    assert (FEATURES.hog_length, FEATURES.length) == (3 * 1568, 4800)
    assert vector.dtype == np.float32
    np.testing.assert_array_equal(vector, np.concatenate([*hogs, *counts]))


def test_a_halved_channel_is_described_at_half_its_size() -> None:
    features = FEATURES.model_copy(update={"halved": (1, 2)})
    _, red, blue = split(PATCH, FEATURES)
    descriptor = cv2.HOGDescriptor((32, 32), (8, 8), (4, 4), (4, 4), 8)
    hogs = [np.ravel(descriptor.compute(halve(channel))) for channel in (red, blue)]
    counts = [histogram(halve(channel), 32) for channel in (red, blue)]
    whole, vector = (FeatureExtractor(item).describe(PATCH) for item in (FEATURES, features))
    np.testing.assert_array_equal(vector[:1568], whole[:1568])
    np.testing.assert_array_equal(vector[1568:4704], np.concatenate(hogs))
    np.testing.assert_array_equal(vector[4704:], [*whole[4704:4736], *np.concatenate(counts)])


def test_a_crop_twice_too_large_is_halved_each_pixel_the_mean_of_four() -> None:
    means = PATCH.reshape(32, 2, 32, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(halve(PATCH), means, atol=0.5)
    np.testing.assert_array_equal(resize(PATCH, 32, 32), halve(PATCH))
    np.testing.assert_array_equal(resize(PATCH, 16, 16), halve(halve(PATCH)))


def test_every_pixel_counts_however_small_the_patch() -> None:
    for size in (64, 60, 50, 37):
        crop = np.zeros((size, size, 3), np.uint8)
        crop[:, ::2] = 200  # on average, stripes of one pixel are an even grey
        assert np.abs(resize(crop, 8, 8).astype(int) - 100).max() <= 20


PIXELS = st.integers(1, 40)


BEYOND = 50
PADDED = np.pad(PATCH, ((BEYOND, BEYOND), (BEYOND, BEYOND), (0, 0)), mode="edge")
CORNERS = st.integers(-BEYOND, 64 + BEYOND - 40)


@example(x=-10, y=20, width=30, height=20)
@example(x=50, y=20, width=30, height=20)
@example(x=20, y=-10, width=20, height=30)
@example(x=20, y=50, width=20, height=30)
@example(x=-BEYOND, y=20, width=40, height=20)
@given(CORNERS, CORNERS, PIXELS, PIXELS)
def test_beyond_each_side_of_an_image_the_outermost_pixels_repeat(
    x: int, y: int, width: int, height: int
) -> None:
    left, top = x + BEYOND, y + BEYOND
    window = cut_window(PATCH, x, y, width, height)
    np.testing.assert_array_equal(window, PADDED[top : top + height, left : left + width])
