"""Convert frames to the input of a network, and boxes in the input back to the frame."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float32Array, Image
from vdet.media import Picture

_MULTIPLE = 32  # of pixels: the stride of the coarsest cells
GREY = 114
"""Value of input pixels outside the frame."""


@dataclass(frozen=True, slots=True)
class InputForm:
    """The form of a network's input.

    Attributes
    ----------
    width, height
        Size of the input, pixels.
    dtype
        uint8, for our own networks: `(1, height, width, 3)`, BGR, filled by the frame. Float32, for
        others: `(1, 3, height, width)`, RGB from 0 to 1; the frame keeps its aspect ratio and lies
        in the middle, with grey around it.
    """

    width: int
    height: int
    dtype: type[np.generic] = np.uint8

    def prepare(self, picture: Picture) -> tuple[npt.NDArray[Any], "Placement"]:
        """Return the input for a frame, and the placement of the frame in it."""
        image, placement = self.scaled(picture)
        if self.dtype is np.uint8:
            return image[np.newaxis], placement
        return cv2.dnn.blobFromImage(image, 1 / 255, swapRB=True), placement

    def scaled(self, picture: Picture) -> tuple[Image, "Placement"]:
        """Return the input as an image, BGR uint8, and the placement of the frame in it."""
        width, height = self.width, self.height
        if self.dtype is not np.uint8:
            factor = min(width / picture.width, height / picture.height)
            width = max(1, round(picture.width * factor))
            height = max(1, round(picture.height * factor))
        left, top = (self.width - width) // 2, (self.height - height) // 2
        placement = Placement(left, top, (width / picture.width, height / picture.height))
        scaled = _scaled_picture(picture, width, height)
        if scaled.shape[:2] == (self.height, self.width):
            return scaled, placement
        canvas = np.full((self.height, self.width, 3), GREY, np.uint8)
        canvas[top : top + height, left : left + width] = scaled
        return canvas, placement


@dataclass(frozen=True, slots=True)
class Placement:
    """Placement of a frame in the input: its top-left pixel, and its scales in x and y."""

    left: int
    top: int
    scales: tuple[float, float]

    def to_frame(self, sides: Float32Array) -> Float32Array:
        """Convert boxes in the input, `(n, 4)` x1, y1, x2, y2, to pixels of the frame."""
        offset = np.array([self.left, self.top] * 2, np.float32)
        return np.asarray((sides - offset) / np.array(self.scales * 2, np.float32))


def size_of_area(width: int, height: int, pixels: float) -> tuple[int, int]:
    """Return an input size of about `pixels`, in the aspect ratio of a frame, for our networks."""
    factor = (pixels / (width * height)) ** 0.5 / _MULTIPLE
    return max(1, round(width * factor)) * _MULTIPLE, max(1, round(height * factor)) * _MULTIPLE


def _scaled_picture(picture: Picture, width: int, height: int) -> Image:
    """Return a picture as BGR in another size; planes are scaled before conversion."""
    planes = picture.planes
    if planes is None:
        return _scaled(picture.image, width, height)
    first, second, third = (_scaled(layer, width, height) for layer in planes.layers)
    return planes.coding.to_bgr((first, second, third))


def _scaled(image: Image, width: int, height: int) -> Image:
    """Return an image in another size; it is halved first while it is more than twice as large.

    So every pixel counts, as in an area average, in a fraction of the time.
    """
    while image.shape[1] >= 2 * width and image.shape[0] >= 2 * height:
        half = max(width, image.shape[1] // 2), max(height, image.shape[0] // 2)
        image = np.asarray(cv2.resize(image, half, interpolation=cv2.INTER_AREA), np.uint8)
        if half == (width, height):
            return image
    return np.asarray(cv2.resize(image, (width, height)), np.uint8)
