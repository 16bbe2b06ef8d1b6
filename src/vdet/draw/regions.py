"""Regions, drawn into BGR images."""

from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from vdet.draw.boxes import GREEN, Color, draw_label, label_tag, line_width
from vdet.geometry import BoolArray
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


def draw_outline(image: Image, corners: Sequence[Point], color: Color, label: str) -> None:
    """Draw the sides of a polygon into an image, and write a label at its highest corner."""
    points = np.round(np.array(corners)).astype(np.int32)
    cv2.polylines(image, [points], True, color, line_width(image), cv2.LINE_AA)
    left, top = min(corners, key=lambda corner: (corner[1], corner[0]))
    height = label_tag(image, label, (0, 0)).height
    draw_label(image, label, (round(left), round(top) + height), color)
