"""Draws lines, boxes with labels, and regions on images and planes."""

import colorsys
import math
from collections.abc import Iterator, Sequence
from functools import cache, lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Box, Float64Array, Image, coverage
from vdet.media.frame import Coding, Planes
from vdet.polygons import Point
from vdet.regions import Regions

Color = tuple[int, int, int]
"""Blue, green, red, 0 to 255."""

Surface = Image | Planes
"""An image, BGR uint8 `(H, W, 3)`, or planes that nothing else uses; drawing changes it."""

_FONT = cv2.FONT_HERSHEY_DUPLEX
_SHIFT = 4
"""Bits of the fraction of a pixel that OpenCV draws with."""
_HALF = 127
"""A pixel of chroma of which more than this, of 255, is covered counts as covered."""
_FARTHEST = 2**15
"""Pixels from the picture's corner; OpenCV takes no coordinates much larger."""

GREEN: Color = (80, 220, 60)
WHITE: Color = (255, 255, 255)
BLACK: Color = (0, 0, 0)
LINE: Color = (0, 200, 255)
ZONE: Color = (255, 170, 60)
RED: Color = (60, 60, 230)
_GOLDEN_RATIO = 0.618034
_SMALLEST_TEXT = 0.35
"""Font scale; smaller digits cannot be read."""
_DASH = 4
"""Length of a dash and of the gap after it, in line widths."""
_DARK = 0.3
"""Brightness outside the regions."""

_BETTER = 0.1
"""Fraction of a label that may be hidden, or hide, before it moves."""


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
    """Draw an arrow; `tip` is the length of its tip, as a fraction of the whole."""
    first, last = ((round(x), round(y)) for x, y in (start, end))
    for layer, value, halved in _layers(surface, color):
        thickness = max(1, round(width / 2**halved))
        cv2.arrowedLine(layer, first, last, value, thickness, cv2.LINE_AA, halved, tip)


def write_text(
    surface: Surface, text: str, origin: Point, scale: float, color: Color, *, within: Box
) -> None:
    """Write a line of text with its lower left corner at `origin`, and only inside `within`.

    `scale` is OpenCV's font scale.
    """
    x1, y1, x2, y2 = corners = _visible(surface, within)
    if x1 >= x2 or y1 >= y2:
        return
    start = round(origin[0]) - x1, round(origin[1]) - y1
    mask = _text_mask(text, start, scale, (y2 - y1, x2 - x1))
    masks = [mask, _halved(mask, x1, y1) if isinstance(surface, Planes) else mask]
    for layer, value, halved in _layers(surface, color):
        part = _part(layer, corners, halved)
        covered = masks[halved].reshape(part.shape[:2] + (1,) * (part.ndim - 2))
        alpha = covered * np.float32(1 / 255)
        part[:] = np.rint(part + (np.array(value, np.float32) - part) * alpha)


@lru_cache(maxsize=256)
def _text_mask(text: str, origin: tuple[int, int], scale: float, shape: tuple[int, int]) -> Image:
    """Return how much of each pixel a text covers; cached, as labels often stay for many frames."""
    mask = np.zeros(shape, np.uint8)
    cv2.putText(mask, text, origin, _FONT, scale, 255, _stroke(scale), cv2.LINE_AA)
    return mask


@lru_cache(maxsize=1024)
def text_size(text: str, scale: float) -> tuple[int, int, int]:
    """Return width, height above the baseline and depth below it of a line of text, pixels."""
    (width, height), baseline = cv2.getTextSize(text, _FONT, scale, _stroke(scale))
    return width, height, baseline


def _stroke(scale: float) -> int:
    return max(1, round(1.5 * scale))


def shade(surface: Surface, corners: Sequence[Point], color: Color, opacity: float) -> None:
    """Mix a colour into a polygon; corners are in pixels."""
    points = np.rint(np.array(corners)).astype(np.int32)
    x, y, width, height = cv2.boundingRect(points)
    x1, y1, x2, y2 = visible = _visible(surface, Box.sized(x, y, width, height))
    mask = np.zeros((y2 - y1, x2 - x1), np.uint8)
    if not mask.size:
        return
    cv2.fillPoly(mask, [points], 255, offset=(-x1, -y1))
    for layer, value, halved in _layers(surface, color):
        part = _part(layer, visible, halved)
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
    """Return the part of a box that lies in the surface."""
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


def color_of(number: int) -> Color:
    """Return a bright colour for an id; the colours of consecutive ids differ clearly."""
    return of_hue(0.33 + number * _GOLDEN_RATIO, 0.85)


def of_hue(hue: float, saturation: float) -> Color:
    """Return a bright colour; a hue of 0 is red, as is one of 1."""
    red, green, blue = colorsys.hsv_to_rgb(hue % 1, saturation, 1)
    return round(255 * blue), round(255 * green), round(255 * red)


def line_width(surface: Surface) -> int:
    """Return a line width in pixels that looks the same at any frame height; 3 at 720 rows."""
    height: int = surface.shape[0]
    return max(1, (height + 120) // 240)


def draw_box(
    surface: Surface, box: Box, color: Color, label: str = "", *, dashed: bool = False
) -> None:
    """Draw an outline just inside a box, and a label above it (inside it at the frame's top).

    Parameters
    ----------
    surface
        Drawn on in place.
    box
        In pixels of the surface; it may reach beyond it.
    dashed
        Whether the outline is dashed, as for a lost vehicle.
    """
    width = line_width(surface)
    for part in _outline(box.rounded, width, _DASH * width if dashed else None):
        fill(surface, part, color)
    if label:
        draw_label(surface, label, (box.x1, box.y1), color)


def draw_label(surface: Surface, text: str, corner: Point, color: Color) -> Box:
    """Write text on a filled tag whose lower left corner is `corner`, and return the tag.

    The corner is `(x, y)` in pixels. The tag is moved so that it lies in the surface. A text that
    is wider than the surface becomes smaller; if it still does not fit, its end is cut off.
    """
    tag, origin, scale = _label_layout(surface, text, corner)
    fill(surface, tag, color)
    write_text(surface, text, origin, scale, text_color(color), within=tag)
    return tag


def draw_labels(
    surface: Surface, boxes: Sequence[Box], texts: Sequence[Sequence[str]], color: Sequence[Color]
) -> None:
    """Write a label at each box: above it, or where it hides less of the boxes and labels.

    A box may have several texts, the longest first; one is taken that is no wider than the box,
    else the last.
    """
    taken = np.array([(box.x1, box.y1, box.x2, box.y2) for box in boxes]).reshape(-1, 4)
    for box, options, tint in zip(boxes, texts, color, strict=True):
        for text in options:
            tag, *_ = _label_layout(surface, text, (0, 0))
            if tag.width <= box.width:
                break
        if text:
            tags = _tag_positions(surface, box, tag)
            hidden = (coverage(tags, taken).sum(axis=1) / _BETTER).astype(int)
            x1, _, _, y2 = best = tags[hidden.argmin()]
            taken = np.vstack([taken, best])
            draw_label(surface, text, (x1, y2), tint)


def _tag_positions(surface: Surface, box: Box, tag: Box) -> Float64Array:
    """Return a tag above and below a box, at its left and its right side, in the surface."""
    rows, columns = surface.shape[:2]
    x = np.array([box.x1, box.x1, box.x2 - tag.width, box.x2 - tag.width])
    y = np.array([box.y1 - tag.height, box.y2, box.y1 - tag.height, box.y2])
    x, y = x.clip(0, max(0, columns - tag.width)), y.clip(0, max(0, rows - tag.height))
    return np.stack([x, y, x + tag.width, y + tag.height], axis=1)


def _label_layout(surface: Surface, text: str, corner: Point) -> tuple[Box, Point, float]:
    """Return the tag of a label, the lower left corner of its text, and the scale of its font."""
    rows, columns = surface.shape[:2]
    scale = max(_SMALLEST_TEXT, min(rows / 1200, columns / (text_size(text, 1)[0] + 20)))
    margin = max(2, round(6 * scale))
    width, height, baseline = text_size(text, scale)
    tag_width, tag_height = width + 2 * margin, height + baseline + margin + (margin + 1) // 2
    left, bottom = (math.floor(value + 0.5) for value in corner)
    x = max(0, min(left, columns - tag_width))
    y = max(0, min(bottom, rows) - tag_height)
    return Box.sized(x, y, tag_width, tag_height), (x + margin, y + margin + height), scale


@cache
def text_color(background: Color) -> Color:
    """Return black or white: the one with the higher contrast ratio (WCAG 2.1) on a background."""
    channels = np.array(background) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    luminance = float(linear @ (0.0722, 0.7152, 0.2126)) + 0.05
    return BLACK if luminance**2 > 0.05 * 1.05 else WHITE


def _outline(box: Box, width: int, dash: int | None) -> Iterator[Box]:
    """Yield the parts of an outline just inside a box; those of a small box overlap."""
    across, down = min(width, box.width), min(width, box.height)
    for start, length in _dashes(box.width, dash):
        yield Box.sized(box.x1 + start, box.y1, length, down)
        yield Box.sized(box.x1 + start, box.y2 - down, length, down)
    for start, length in _dashes(box.height, dash):
        yield Box.sized(box.x1, box.y1 + start, across, length)
        yield Box.sized(box.x2 - across, box.y1 + start, across, length)


def _dashes(side: float, dash: int | None) -> list[tuple[int, int]]:
    """Return starts and lengths of the dashes of a side, with one at each end; None for none.

    They are about `dash` pixels long, and so are the gaps.
    """
    length = int(side)
    if dash is None:
        return [(0, length)]
    gaps = max(1, round((length - dash) / (2 * dash)))
    dash = min(dash, max(1, length // 3))
    starts = np.linspace(0, length - dash, gaps + 1).round().astype(int).tolist()
    return [(start, dash) for start in starts]


def draw_regions(image: Image, regions: Regions) -> Image:
    """Return a copy of an image that is dark outside the regions, with outlines and names."""
    dark = (image * _DARK).astype(np.uint8)
    picture = np.ascontiguousarray(np.where(regions.pixels[..., np.newaxis], image, dark))
    for polygons, color in ((regions.included, GREEN), (regions.excluded, RED)):
        for name, corners in polygons.items():
            draw_lines(picture, corners, color, line_width(picture), closed=True)
            left, top = min(corners, key=lambda corner: (corner[1], corner[0]))
            tag, *_ = _label_layout(picture, name, (0, 0))
            draw_label(picture, name, (round(left), round(top) + tag.height), color)
    return picture
