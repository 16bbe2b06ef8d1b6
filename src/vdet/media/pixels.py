"""Convert decoded pictures to upright BGR images, and BGR images to pictures to be encoded."""

import av
import cv2
import numpy as np

from vdet.media.images import Image

_TURNS = {
    90: cv2.ROTATE_90_COUNTERCLOCKWISE,
    180: cv2.ROTATE_180,
    270: cv2.ROTATE_90_CLOCKWISE,
}


def quarter_turns(picture: av.VideoFrame) -> int:
    """Return the rotation of the display matrix: 0, 90, 180 or 270° counter-clockwise."""
    return round(picture.rotation / 90) * 90 % 360


def to_bgr(picture: av.VideoFrame, rotation: int) -> Image:
    """Return `picture` turned by `rotation` degrees counter-clockwise, BGR uint8, (H, W, 3).

    Colour matrix and range are those that the picture names; else BT.601 and limited.
    """
    image = np.asarray(picture.to_ndarray(format="bgr24", threads=1), dtype=np.uint8)
    if rotation:
        return cv2.rotate(image, _TURNS[rotation]).astype(np.uint8, copy=False)
    if picture.format.name == "bgr24":
        return image.copy()  # it shares the memory of the decoder
    return np.ascontiguousarray(image)


def resized(image: Image, width: int, height: int) -> Image:
    """Return `image` scaled to `width` × `height` pixels; unchanged where it has that size."""
    if image.shape[:2] == (height, width):
        return image
    scaled = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return scaled.astype(np.uint8, copy=False)


def to_i420(image: Image) -> av.VideoFrame:
    """Return a BGR image (H, W, 3) as a yuv420p picture, BT.601, limited range.

    4:2:0 needs even sides: the last row or column of an odd one is repeated.
    """
    height, width = image.shape[:2]
    if height % 2 or width % 2:
        edge = cv2.BORDER_REPLICATE
        image = cv2.copyMakeBorder(image, 0, height % 2, 0, width % 2, edge).astype(np.uint8)
    planes = cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420).astype(np.uint8, copy=False)
    return av.VideoFrame.from_ndarray(planes, format="yuv420p")
