"""From a frame to the input of a network, and from boxes in the input back to the frame."""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float32Array, Image
from vdet.media import Picture

_MULTIPLE = 32  # of pixels: the stride of the coarsest cells
GREY = 114
"""Value of pixels of the input beyond the frame."""

Fit = Literal["stretch", "center", "corner"]


@dataclass(frozen=True, slots=True)
class InputForm:
    """The form of a network's input.

    Attributes
    ----------
    width, height
        Size of the input, pixels.
    fit
        stretch: the frame fills the input. center, corner: it keeps its aspect ratio and lies in
        the middle or at the top left, with grey around it.
    is_rgb
        The channels are red, green, blue; else blue, green, red.
    factor
        Values from 0 to 255 are multiplied by it.
    rows_first
        The shape is `(1, height, width, 3)`; else `(1, 3, height, width)`.
    dtype
        Type of the values.
    """

    width: int
    height: int
    fit: Fit = "stretch"
    is_rgb: bool = False
    factor: float = 1.0
    rows_first: bool = False
    dtype: type[np.generic] = np.float32

    def prepare(self, picture: Picture) -> tuple[npt.NDArray[Any], "Placement"]:
        """Return the input that shows a frame, and where the frame lies in it."""
        image, place = self.scaled(picture)
        if self.is_rgb:
            image = image[..., ::-1]
        values = image if self.rows_first else image.transpose(2, 0, 1)
        if self.dtype is not np.uint8:
            values = np.multiply(values, self.factor, dtype=np.float32).astype(self.dtype)
        return np.ascontiguousarray(values[np.newaxis]), place

    @property
    def grey(self) -> Image:
        """A grey picture of the size of the input."""
        return np.full((self.height, self.width, 3), GREY, np.uint8)

    def scaled(self, picture: Picture) -> tuple[Image, "Placement"]:
        """Return the input as a picture, BGR uint8, and where the frame lies in it."""
        place = self._place(picture.width, picture.height)
        scaled = _scaled_picture(picture, *place.size)
        if place.size == (self.width, self.height):
            return scaled, place
        canvas, (width, height), left, top, _ = self.grey, *place
        canvas[top : top + height, left : left + width] = scaled
        return canvas, place

    def _place(self, columns: int, rows: int) -> "Placement":
        size = self.width, self.height
        if self.fit != "stretch":
            factor = min(self.width / columns, self.height / rows)
            size = max(1, round(columns * factor)), max(1, round(rows * factor))
        is_centered = self.fit == "center"
        left = (self.width - size[0]) // 2 * is_centered
        top = (self.height - size[1]) // 2 * is_centered
        return Placement(size, left, top, (size[0] / columns, size[1] / rows))


class Placement(NamedTuple):
    """Where a frame lies in the input: its size there, its top left pixel, its scales x and y."""

    size: tuple[int, int]
    left: int
    top: int
    scales: tuple[float, float]

    def to_frame(self, boxes: Float32Array) -> Float32Array:
        """Return boxes of the input, `(n, 4)` x1, y1, x2, y2, in pixels of the frame."""
        offset = np.array([self.left, self.top] * 2, np.float32)
        return np.asarray((boxes - offset) / np.array(self.scales * 2, np.float32))


def scaled_to(image: Image, width: int, height: int) -> Image:
    """Return the image in another size; it is halved first while it is more than twice as large.

    Thus every pixel counts, as in an area average, in a fraction of its time.
    """
    while image.shape[1] >= 2 * width and image.shape[0] >= 2 * height:
        half = max(width, image.shape[1] // 2), max(height, image.shape[0] // 2)
        image = np.asarray(cv2.resize(image, half, interpolation=cv2.INTER_AREA), np.uint8)
        if half == (width, height):
            return image
    return np.asarray(cv2.resize(image, (width, height)), np.uint8)


def _scaled_picture(picture: Picture, width: int, height: int) -> Image:
    """Return a picture as BGR in another size; planes are scaled before they are converted."""
    planes = picture.planes
    if planes is None:
        return scaled_to(picture.image, width, height)
    first, second, third = (scaled_to(layer, width, height) for layer in planes.layers)
    return planes.coding.to_bgr((first, second, third))


def size_of_area(width: int, height: int, pixels: float) -> tuple[int, int]:
    """Return width and height of about `pixels` in the shape of a frame, for our own networks."""
    factor = (pixels / (width * height)) ** 0.5 / _MULTIPLE
    return max(1, round(width * factor)) * _MULTIPLE, max(1, round(height * factor)) * _MULTIPLE
