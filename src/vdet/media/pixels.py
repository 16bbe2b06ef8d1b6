"""Convert decoded pictures to BGR images."""

import av
import cv2
import numpy as np

from vdet.media.images import Image


def to_bgr(picture: av.VideoFrame) -> Image:
    """Return `picture` as coded, BGR uint8, (H, W, 3).

    Colour matrix and range are those that the picture names; else BT.601 and limited.
    """
    image = np.asarray(picture.to_ndarray(format="bgr24", threads=1), dtype=np.uint8)
    if picture.format.name == "bgr24":
        return image.copy()  # it shares the memory of the decoder
    return np.ascontiguousarray(image)


def resized(image: Image, width: int, height: int) -> Image:
    """Return `image` scaled to `width` × `height` pixels; unchanged where it has that size."""
    if image.shape[:2] == (height, width):
        return image
    scaled = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return scaled.astype(np.uint8, copy=False)
