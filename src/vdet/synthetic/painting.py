"""Colours, and outlines filled with them to a sixteenth of a pixel."""

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float64Array
from vdet.draw.paint import Color
from vdet.media.images import Image

_SHIFT = 4  # fractional bits of the coordinates given to OpenCV


def fill(image: Image, outline: Float64Array, color: Color) -> None:
    """Fill an outline of pixels `(n, 2)` with smooth edges; an empty outline changes nothing."""
    if len(outline):
        cv2.fillPoly(image, [_fixed(outline)], color, cv2.LINE_AA, _SHIFT)


def fill_mask(mask: Image, outline: Float64Array) -> None:
    """Set the pixels `(H, W)` inside an outline to 255, its border included."""
    if len(outline):
        cv2.fillPoly(mask, [_fixed(outline)], 255, cv2.LINE_8, _SHIFT)


def shaded(color: Color, factor: float) -> Color:
    """Return a colour made darker (below 1) or lighter (above 1)."""
    blue, green, red = (min(255, max(0, round(value * factor))) for value in color)
    return blue, green, red


def mixed(color: Color, other: Color, share: float) -> Color:
    """Return a colour with this `share` of another one, 0 to 1."""
    blue, green, red = (round(a + (b - a) * share) for a, b in zip(color, other, strict=True))
    return blue, green, red


def _fixed(outline: Float64Array) -> npt.NDArray[np.int32]:
    return np.rint(outline * (1 << _SHIFT)).astype(np.int32)
