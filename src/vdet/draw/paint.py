"""What all drawings are made of: rectangles, lines, text and shades, on BGR images or on planes.

On planes, colours are drawn at half the resolution, as 4:2:0 has it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Box, Int32Array
from vdet.media.coding import LUMA_SHARES, Coding
from vdet.media.images import Image
from vdet.media.planes import Planes

Color = tuple[int, int, int]
"""Blue, green, red, 0 to 255."""

Surface = Image | Planes
"""An image, BGR uint8 `(H, W, 3)`, or planes of their own; what is drawn into is changed."""

_FONT = cv2.FONT_HERSHEY_DUPLEX


@dataclass(frozen=True, slots=True)
class TextStyle:
    """Size of a text, as OpenCV counts it, and the width of its strokes, pixels."""

    scale: float
    stroke: int


def fill(surface: Surface, box: Box, color: Color) -> None:
    """Fill the part of a box that lies in the surface."""
    height, width = surface.shape[:2]
    x1, y1, x2, y2 = box.clipped(width, height).pixels
    rows, columns = slice(y1, y2), slice(x1, x2)
    if not isinstance(surface, Planes):
        surface[rows, columns] = color
        return
    luma, blue, red = _coded(color, surface.coding)
    surface.luma[rows, columns] = luma
    if x1 < x2 and y1 < y2:
        half = _half(rows), _half(columns)
        surface.blue[half], surface.red[half] = blue, red


def draw_lines(
    surface: Surface,
    points: Int32Array,
    color: Color,
    width: int,
    *,
    closed: bool = False,
    shift: int = 0,
) -> None:
    """Draw a smooth line from point to point, int32 `(n, 2)` of x and y in pixels / 2**shift."""
    if not isinstance(surface, Planes):
        cv2.polylines(surface, [points], closed, color, width, cv2.LINE_AA, shift)
        return
    values, widths = _coded(color, surface.coding), (width, *[max(1, round(width / 2))] * 2)
    for layer, value, thickness, more in zip(
        surface.layers, values, widths, (0, 1, 1), strict=True
    ):
        cv2.polylines(layer, [points], closed, value, thickness, cv2.LINE_AA, shift + more)


def draw_arrow(
    surface: Surface,
    start: Sequence[float],
    end: Sequence[float],
    color: Color,
    width: int,
    *,
    tip: float,
) -> None:
    """Draw an arrow whose tip has the share `tip` of its length."""
    first, last = np.asarray(start, np.float64), np.asarray(end, np.float64)
    back = (first - last) * tip
    turned = np.array([-back[1], back[0]])
    wings = last + back + turned, last + back - turned
    for line in ([first, last], [wings[0], last, wings[1]]):
        draw_lines(surface, np.rint(line).astype(np.int32), color, width)


def write_text(
    surface: Surface,
    text: str,
    origin: tuple[int, int],
    style: TextStyle,
    color: Color,
    *,
    within: Box,
) -> None:
    """Write a line of text from its lower left corner on; no stroke lies outside `within`."""
    if not isinstance(surface, Planes):
        cv2.putText(surface, text, origin, _FONT, style.scale, color, style.stroke, cv2.LINE_AA)
        return
    height, width = surface.shape
    x1, y1, x2, y2 = within.clipped(width, height).pixels
    mask = np.zeros((y2 - y1, x2 - x1), np.uint8)
    if mask.size:
        place = origin[0] - x1, origin[1] - y1
        cv2.putText(mask, text, place, _FONT, style.scale, 255, style.stroke, cv2.LINE_AA)
        blend(surface, mask, (x1, y1), color)


def text_size(text: str, style: TextStyle) -> tuple[int, int, int]:
    """Return width, height above the baseline and depth below it of a line of text, pixels."""
    (width, height), baseline = cv2.getTextSize(text, _FONT, style.scale, style.stroke)
    return width, height, baseline


def blend(
    surface: Surface,
    mask: Image,
    corner: tuple[int, int],
    color: Color,
    opacity: float = 1.0,
) -> None:
    """Mix a colour into the pixels of a mask.

    Parameters
    ----------
    mask
        uint8 `(h, w)`: how much of a pixel is covered, 0 to 255. It lies in the surface.
    corner
        x and y of its first pixel.
    """
    x, y = corner
    height, width = mask.shape
    if not mask.size:
        return
    rows, columns = slice(y, y + height), slice(x, x + width)
    if not isinstance(surface, Planes):
        _mix(surface[rows, columns], mask[..., np.newaxis], color, opacity)
        return
    luma, blue, red = _coded(color, surface.coding)
    _mix(surface.luma[rows, columns], mask, luma, opacity)
    around = y % 2, (y + height) % 2, x % 2, (x + width) % 2
    even = cv2.copyMakeBorder(mask, *around, cv2.BORDER_CONSTANT)
    size = even.shape[1] // 2, even.shape[0] // 2
    small = np.asarray(cv2.resize(even, size, interpolation=cv2.INTER_AREA), np.uint8)
    half = _half(rows), _half(columns)
    _mix(surface.blue[half], small, blue, opacity)
    _mix(surface.red[half], small, red, opacity)


def _mix(part: Image, mask: Image, color: npt.ArrayLike, opacity: float) -> None:
    shares = mask * np.float32(opacity / 255)
    part[:] = np.rint(part + (np.asarray(color, np.float32) - part) * shares)


def _half(pixels: slice) -> slice:
    """Return the values of chroma that stand for some of these pixels."""
    return slice(pixels.start // 2, -(-pixels.stop // 2))


@cache
def _coded(color: Color, coding: Coding) -> tuple[int, int, int]:
    """Return luma, blue and red chroma of a colour."""
    blue, green, red = (value / 255 for value in color)
    of_red, of_blue = LUMA_SHARES[coding.matrix]
    luma = of_red * red + (1 - of_red - of_blue) * green + of_blue * blue
    chroma = (blue - luma) / (2 - 2 * of_blue), (red - luma) / (2 - 2 * of_red)
    base, luma_span, chroma_span = (0, 255, 255) if coding.full_range else (16, 219, 224)
    values = base + luma_span * luma, *(128 + chroma_span * each for each in chroma)
    first, second, third = (min(255, round(value)) for value in values)
    return first, second, third
