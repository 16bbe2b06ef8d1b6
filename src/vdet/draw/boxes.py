"""Boxes with labels."""

import colorsys
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from vdet.boxes import Box
from vdet.draw.paint import Color, Surface, TextStyle, fill, text_size, write_text

GREEN: Color = (80, 220, 60)
WHITE: Color = (255, 255, 255)
BLACK: Color = (0, 0, 0)
_GOLDEN_RATIO = 0.618034
_SMALLEST_TEXT = 0.35
"""Font scale; smaller digits cannot be read."""
_DASH = 4
"""Length of a dash and of the gap after it, in line widths."""


def color_of(number: int) -> Color:
    """Return a bright colour for an id; neighbouring ids differ clearly."""
    hue = (0.33 + number * _GOLDEN_RATIO) % 1
    red, green, blue = colorsys.hsv_to_rgb(hue, 0.85, 1)
    return round(255 * blue), round(255 * green), round(255 * red)


def line_width(surface: Surface, thickness: float = 1.0) -> int:
    """Return a line width in pixels that looks the same at any frame height; 3 at 720 rows.

    `thickness` is a factor of it.
    """
    height: int = surface.shape[0]
    return max(1, round(thickness * max(1, (height + 120) // 240)))


def draw_box(
    surface: Surface,
    box: Box,
    color: Color,
    label: str = "",
    *,
    dashed: bool = False,
    thickness: float = 1.0,
) -> None:
    """Draw an outline just inside a box, and a label above it (inside it at the frame's top).

    Parameters
    ----------
    surface
        It is changed.
    box
        In pixels of the surface; it may reach beyond it.
    dashed
        Whether the outline has gaps. This marks a box that is predicted, not detected.
    thickness
        Factor of the width of the outline.
    """
    width = line_width(surface, thickness)
    dash = _DASH * width if dashed else None
    for side in _sides(box.rounded, width):
        for part in _dashes(side, dash) if dash else [side]:
            fill(surface, part, color)
    if label:
        draw_label(surface, label, (box.x1, box.y1), color)


def draw_label(surface: Surface, text: str, corner: tuple[float, float], color: Color) -> Box:
    """Write text on a filled tag whose lower left corner is `corner`, and return the tag.

    The corner is `(x, y)` in pixels. The tag is moved so that it lies in the surface. A text that
    is wider than the surface becomes smaller; if it still does not fit, its end is cut off.
    """
    label = _lay_out(surface, text, corner)
    fill(surface, label.tag, color)
    write_text(surface, text, label.origin, label.style, text_color(color), within=label.tag)
    return label.tag


def label_tag(surface: Surface, text: str, corner: tuple[float, float]) -> Box:
    """Return the tag that `draw_label` would draw."""
    return _lay_out(surface, text, corner).tag


@dataclass(frozen=True, slots=True)
class _Label:
    """Where a label's tag is, and how its text is written; `origin` is its lower left corner."""

    tag: Box
    origin: tuple[int, int]
    style: TextStyle


def _lay_out(surface: Surface, text: str, corner: tuple[float, float]) -> _Label:
    rows, columns = surface.shape[:2]
    scale = _text_scale(surface, text)
    style = TextStyle(scale, max(1, round(1.5 * scale)))
    margin = max(3, round(6 * scale))
    width, height, baseline = text_size(text, style)
    tag_width, tag_height = width + 2 * margin, height + baseline + margin + (margin + 1) // 2
    left, bottom = (math.floor(value + 0.5) for value in corner)
    x = max(0, min(left, columns - tag_width))
    y = max(0, min(bottom, rows) - tag_height)
    tag = Box.sized(x, y, tag_width, tag_height)
    return _Label(tag, (x + margin, y + margin + height), style)


def text_color(background: Color) -> Color:
    """Return black or white: the one with the higher contrast ratio (WCAG 2.1) on a background."""
    shares = np.array(background) / 255
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    luminance = float(linear @ (0.0722, 0.7152, 0.2126))
    on_black, on_white = (luminance + 0.05) / 0.05, 1.05 / (luminance + 0.05)
    return BLACK if on_black > on_white else WHITE


def _text_scale(surface: Surface, text: str) -> float:
    """Return the font scale that fits the surface's height, or less so that the text fits in."""
    rows, columns = (int(side) for side in surface.shape[:2])
    width, _, _ = text_size(text, TextStyle(1, 1))
    return max(_SMALLEST_TEXT, min(rows / 1200, columns / (width + 20)))


def _sides(box: Box, width: int) -> Iterator[Box]:
    """Give the four sides of an outline just inside a box; those of a small box overlap."""
    across, down = min(width, box.width), min(width, box.height)
    yield replace(box, y2=box.y1 + down)
    yield replace(box, y1=box.y2 - down)
    yield replace(box, x2=box.x1 + across)
    yield replace(box, x1=box.x2 - across)


def _dashes(side: Box, dash: int) -> Iterator[Box]:
    """Cut a side into dashes of about `dash` pixels and equal gaps, with a dash at each end."""
    length = int(max(side.width, side.height))
    gaps = max(1, round((length - dash) / (2 * dash)))
    dash = min(dash, max(1, length // 3))
    for start in np.linspace(0, length - dash, gaps + 1).round().astype(int).tolist():
        if side.width > side.height:
            yield Box.sized(side.x1 + start, side.y1, dash, side.height)
        else:
            yield Box.sized(side.x1, side.y1 + start, side.width, dash)
