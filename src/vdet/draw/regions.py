"""Regions: dark outside, with outlines and names."""

from collections.abc import Mapping, Sequence

import numpy as np

from vdet.boxes import BoolArray
from vdet.draw.boxes import GREEN, draw_label, label_tag, line_width
from vdet.draw.paint import Color, Surface, draw_lines
from vdet.media.images import Image

Point = tuple[float, float]

RED: Color = (60, 60, 230)
_DARK = 0.3
"""Brightness of what lies outside."""


def draw_regions(
    image: Image,
    pixels: BoolArray,
    included: Mapping[str, Sequence[Point]],
    excluded: Mapping[str, Sequence[Point]],
) -> Image:
    """Return a copy of an image that is dark outside the regions, with outlines and names.

    Parameters
    ----------
    pixels
        bool `(H, W)`: what lies in the regions.
    included, excluded
        The corners of polygons by their names, pixels.
    """
    picture = np.where(pixels[..., np.newaxis], image, (image * _DARK).astype(np.uint8))
    picture = np.ascontiguousarray(picture)
    for color, polygons in ((GREEN, included), (RED, excluded)):
        for name, corners in polygons.items():
            draw_outline(picture, corners, color, name)
    return picture


def draw_outline(surface: Surface, corners: Sequence[Point], color: Color, label: str) -> None:
    """Draw the sides of a polygon, and write a label at its highest corner."""
    points = np.round(np.array(corners)).astype(np.int32)
    draw_lines(surface, points, color, line_width(surface), closed=True)
    left, top = min(corners, key=lambda corner: (corner[1], corner[0]))
    height = label_tag(surface, label, (0, 0)).height
    draw_label(surface, label, (round(left), round(top) + height), color)
