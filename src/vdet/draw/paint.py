"""The elements of all drawings: rectangles, lines, text and shades, on BGR images or on planes.

On planes, colours are drawn at half the resolution, as 4:2:0 has it.
"""

from collections.abc import Iterator, Sequence
from functools import cache, lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Box, Image
from vdet.media.coding import Coding
from vdet.media.frame import Planes
from vdet.polygons import Point

Color = tuple[int, int, int]
"""Blue, green, red, 0 to 255."""

Surface = Image | Planes
"""An image, BGR uint8 `(H, W, 3)`, or planes of their own; drawing changes it."""

_FONT = cv2.FONT_HERSHEY_DUPLEX
_SHIFT = 4
"""Bits of the fraction of a pixel that OpenCV draws with."""
_HALF = 127
"""A pixel of chroma of which more than this, of 255, is covered counts as covered."""
_FARTHEST = 2**15
"""Pixels from the picture's corner; OpenCV takes no coordinates much larger."""


def fill(surface: Surface, box: Box, color: Color) -> None:
    """Fill the part of a box that lies in the surface."""
    x1, y1, x2, y2 = corners = _visible(surface, box)
    if x1 < x2 and y1 < y2:
        for layer, value, halved in _layers(surface, color):
            _part(layer, corners, halved)[:] = value


def draw_lines(
    surface: Surface, points: npt.ArrayLike, color: Color, width: int, *, closed: bool = False
) -> None:
    """Draw a smooth line from point to point, `(n, 2)` of x and y in pixels."""
    near = np.clip(np.asarray(points, np.float64), -_FARTHEST, _FARTHEST)
    fixed = [np.rint(near * 2**_SHIFT).astype(np.int32)]
    for layer, value, halved in _layers(surface, color):
        thickness = max(1, round(width / 2**halved))
        cv2.polylines(layer, fixed, closed, value, thickness, cv2.LINE_AA, _SHIFT + halved)


def draw_arrow(
    surface: Surface, start: Point, end: Point, color: Color, width: int, *, tip: float
) -> None:
    """Draw an arrow whose tip has the share `tip` of its length."""
    first, last = ((round(x), round(y)) for x, y in (start, end))
    for layer, value, halved in _layers(surface, color):
        thickness = max(1, round(width / 2**halved))
        cv2.arrowedLine(layer, first, last, value, thickness, cv2.LINE_AA, halved, tip)


def write_text(
    surface: Surface, text: str, origin: Point, scale: float, color: Color, *, within: Box
) -> None:
    """Write a line of text with its lower left corner at `origin`, and only inside `within`.

    `scale` is the size as OpenCV counts it.
    """
    x1, y1, x2, y2 = corners = _visible(surface, within)
    if x1 >= x2 or y1 >= y2:
        return
    place = round(origin[0]) - x1, round(origin[1]) - y1
    mask = _text_mask(text, place, scale, (y2 - y1, x2 - x1))
    masks = [mask, _halved(mask, x1, y1) if isinstance(surface, Planes) else mask]
    for layer, value, halved in _layers(surface, color):
        part = _part(layer, corners, halved)
        covered = masks[halved].reshape(part.shape[:2] + (1,) * (part.ndim - 2))
        shares = covered * np.float32(1 / 255)
        part[:] = np.rint(part + (np.array(value, np.float32) - part) * shares)


@lru_cache(maxsize=256)
def _text_mask(text: str, place: tuple[int, int], scale: float, shape: tuple[int, int]) -> Image:
    """Return how much of each pixel a text covers; labels often stay for many frames."""
    mask = np.zeros(shape, np.uint8)
    cv2.putText(mask, text, place, _FONT, scale, 255, _stroke(scale), cv2.LINE_AA)
    return mask


def text_size(text: str, scale: float) -> tuple[int, int, int]:
    """Return width, height above the baseline and depth below it of a line of text, pixels."""
    (width, height), baseline = cv2.getTextSize(text, _FONT, scale, _stroke(scale))
    return width, height, baseline


def _stroke(scale: float) -> int:
    return max(1, round(1.5 * scale))


def shade(surface: Surface, corners: Sequence[Point], color: Color, opacity: float) -> None:
    """Mix a colour into a polygon; corners are in pixels."""
    points = np.rint(np.array(corners)).astype(np.int32)
    x1, y1, x2, y2 = _visible(surface, Box.sized(*cv2.boundingRect(points)))
    mask = np.zeros((y2 - y1, x2 - x1), np.uint8)
    if not mask.size:
        return
    cv2.fillPoly(mask, [points], 255, offset=(-x1, -y1))
    for layer, value, halved in _layers(surface, color):
        part = _part(layer, (x1, y1, x2, y2), halved)
        covered = _halved(mask, x1, y1) if halved else mask
        table = np.arange(256)[:, None] * (1 - opacity) + np.array(value) * opacity
        mixed = cv2.LUT(part, np.rint(table).astype(np.uint8)[None])
        cv2.copyTo(mixed, (covered > _HALF).view(np.uint8), part)


def _halved(mask: Image, x: int, y: int) -> Image:
    """Return a mask whose first pixel is at `(x, y)` at the resolution of chroma."""
    height, width = mask.shape
    around = y % 2, (y + height) % 2, x % 2, (x + width) % 2
    even = cv2.copyMakeBorder(mask, *around, cv2.BORDER_CONSTANT)
    size = even.shape[1] // 2, even.shape[0] // 2
    return np.asarray(cv2.resize(even, size, interpolation=cv2.INTER_AREA), np.uint8)


def _visible(surface: Surface, box: Box) -> tuple[int, int, int, int]:
    """Return the sides of the part of a box that lies in the surface."""
    height, width = surface.shape[:2]
    return box.rounded.clipped(width, height).pixels


def _layers(surface: Surface, color: Color) -> Iterator[tuple[Image, Sequence[int], int]]:
    """Yield each layer, the value of a colour in it, and how often its sides are halved."""
    if isinstance(surface, Planes):
        yield from zip(surface.layers, _coded(color, surface.coding), (0, 1, 1), strict=True)
    else:
        yield surface, color, 0


def _part(layer: Image, corners: tuple[int, int, int, int], halved: int) -> Image:
    """Return the values of a layer that stand for some of the pixels between these sides."""
    x1, y1, x2, y2 = corners
    rows = slice(y1 >> halved, (y2 + halved) >> halved)
    return layer[rows, x1 >> halved : (x2 + halved) >> halved]


@cache
def _coded(color: Color, coding: Coding) -> list[tuple[int]]:
    """Return luma, blue and red chroma of a colour."""
    planes = Planes.of_image(np.full((2, 2, 3), color, np.uint8), coding)
    return [(int(layer[0, 0]),) for layer in planes.layers]
