"""Images are converted to pictures for the encoder, and back."""

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.media.pixels import resized, to_bgr, to_i420


@given(st.integers(1, 70), st.integers(1, 70))
def test_a_coded_picture_has_even_sides(width: int, height: int) -> None:
    picture = to_i420(np.zeros((height, width, 3), np.uint8))
    assert (picture.width, picture.height) == (width + width % 2, height + height % 2)
    assert picture.format.name == "yuv420p"


def test_an_odd_side_grows_by_its_last_row_or_column() -> None:
    image = np.zeros((5, 7, 3), np.uint8)
    image[4:, :] = image[:, 6:] = 200
    luma = to_i420(image).to_ndarray()[:6, :8]
    assert (luma[5] == luma[4]).all()
    assert (luma[:, 7] == luma[:, 6]).all()
    assert luma[5, 7] > luma[0, 0]


@pytest.mark.parametrize(
    "color", [(255, 255, 255), (0, 0, 0), (40, 30, 210), (200, 60, 20), (128, 128, 128)]
)
def test_colours_are_the_same_after_encoding_and_decoding(color: tuple[int, int, int]) -> None:
    image = np.full((32, 48, 3), color, np.uint8)
    assert np.abs(to_bgr(to_i420(image)).astype(int) - color).max() <= 3


def test_the_image_of_a_bgr_picture_is_a_copy() -> None:
    picture = av.VideoFrame.from_ndarray(np.zeros((32, 64, 3), np.uint8), format="bgr24")
    to_bgr(picture)[:] = 255
    assert not picture.to_ndarray().any()


def test_an_image_of_the_right_size_is_unchanged() -> None:
    image = np.zeros((10, 20, 3), np.uint8)
    assert resized(image, 20, 10) is image
    assert resized(image, 30, 40).shape == (40, 30, 3)
