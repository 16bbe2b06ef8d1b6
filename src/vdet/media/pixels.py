"""Convert decoded pictures to upright BGR images, and BGR images to pictures to be encoded."""

import math
from collections.abc import Mapping
from typing import cast

import av
import cv2
import numpy as np
import numpy.typing as npt

from vdet.media.frame import Orientation
from vdet.media.images import Image

_TURNS = {
    90: cv2.ROTATE_90_COUNTERCLOCKWISE,
    180: cv2.ROTATE_180,
    270: cv2.ROTATE_90_CLOCKWISE,
}
_COSINES = {0: 1, 90: 0, 180: -1, 270: 0}
_SLANT = 0.1  # as much of a matrix may differ from a quarter turn; that is 6°


def orientation(picture: av.VideoFrame) -> Orientation | None:
    """Return what the display matrix asks for; None if that is no quarter turn."""
    matrix = _display_matrix(picture)
    if matrix is None:
        return Orientation()
    mirrored = bool(np.linalg.det(matrix) < 0)
    if mirrored:
        matrix = matrix * [[-1], [1]]  # of x
    degrees = round(math.degrees(math.atan2(-matrix[0, 1], matrix[0, 0])) / 90) * 90 % 360
    cosine, sine = _COSINES[degrees], _COSINES[(degrees - 90) % 360]
    scale = math.sqrt(abs(np.linalg.det(matrix)))
    if np.abs(matrix - scale * np.array([[cosine, -sine], [sine, cosine]])).max() > _SLANT * scale:
        return None
    return Orientation(degrees, mirrored)


def _display_matrix(picture: av.VideoFrame) -> npt.NDArray[np.float64] | None:
    """Return what x and y become, as rows, of the display matrix (ISO/IEC 14496-12, 6.2.2)."""
    try:
        side_data = cast(Mapping[str, bytes], picture.side_data)  # it is not typed as such
    except ValueError:  # some of it is of a kind that PyAV does not know, as EXIF
        angle = math.radians(picture.rotation)
        cosine, sine = math.cos(angle), math.sin(angle)
        return np.array([[cosine, -sine], [sine, cosine]])
    if "DISPLAYMATRIX" not in side_data:
        return None
    return np.frombuffer(bytes(side_data["DISPLAYMATRIX"]), np.int32).reshape(3, 3)[:2, :2] / 65_536


def to_bgr(picture: av.VideoFrame) -> Image:
    """Return `picture` as coded, BGR uint8, (H, W, 3).

    Colour matrix and range are those that the picture names; else BT.601 and limited.
    """
    image = np.asarray(picture.to_ndarray(format="bgr24", threads=1), dtype=np.uint8)
    if picture.format.name == "bgr24":
        return image.copy()  # it shares the memory of the decoder
    return np.ascontiguousarray(image)


def upright(image: Image, orientation: Orientation) -> Image:
    """Return `image` as it is to be seen."""
    turned: cv2.typing.MatLike = cv2.flip(image, 1) if orientation.mirrored else image
    if orientation.rotation:
        turned = cv2.rotate(turned, _TURNS[orientation.rotation])
    return turned.astype(np.uint8, copy=False)


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
