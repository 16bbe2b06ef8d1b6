"""Decoded pictures are converted to images, and images scaled."""

import av
import numpy as np

from vdet.media.pixels import resized, to_bgr


def test_the_image_of_a_bgr_picture_is_a_copy() -> None:
    picture = av.VideoFrame.from_ndarray(np.zeros((32, 64, 3), np.uint8), format="bgr24")
    to_bgr(picture)[:] = 255
    assert not picture.to_ndarray().any()


def test_an_image_of_the_right_size_is_unchanged() -> None:
    image = np.zeros((10, 20, 3), np.uint8)
    assert resized(image, 20, 10) is image
    assert resized(image, 30, 40).shape == (40, 30, 3)
