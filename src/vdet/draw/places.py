"""Lines and zones with their counts, and regions."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from vdet.boxes import BoolArray, Box
from vdet.draw.boxes import GREEN, draw_label, label_tag, line_width
from vdet.draw.paint import Color, Surface, blend, draw_arrow, draw_lines
from vdet.media.images import Image

Point = tuple[float, float]

LINE: Color = (0, 200, 255)
ZONE: Color = (255, 170, 60)
RED: Color = (60, 60, 230)
_DARK = 0.3
"""Brightness of what lies outside."""
_SHADE = 0.18
"""How much of the colour of a zone covers what is in it."""
_ARROW = 0.035
"""Length of the arrows, share of the surface's height."""


@dataclass(frozen=True, slots=True)
class DrawnLine:
    """A line from `start` to `end`, pixels; `left` and `right` are a direction and its count."""

    name: str
    start: Point
    end: Point
    left: tuple[str, int]
    right: tuple[str, int]


@dataclass(frozen=True, slots=True)
class DrawnZone:
    """A zone with its corners, pixels, and how many vehicles are in it now."""

    name: str
    corners: tuple[Point, ...]
    present: int


def draw_counts(surface: Surface, lines: Sequence[DrawnLine], zones: Sequence[DrawnZone]) -> None:
    """Draw zones and lines with their counts.

    A line has an arrow at its end. At its start, where no vehicle crosses it, an arrow points into
    each direction, with the name and the count.
    """
    for zone in zones:
        _draw_zone(surface, zone)
    for line in lines:
        _draw_line(surface, line)


def _draw_zone(surface: Surface, zone: DrawnZone) -> None:
    points = np.round(np.array(zone.corners)).astype(np.int32)
    rows, columns = surface.shape[:2]
    x1, y1, x2, y2 = Box.sized(*cv2.boundingRect(points)).clipped(columns, rows).pixels
    mask = np.zeros((y2 - y1, x2 - x1), np.uint8)
    if mask.size:
        cv2.fillPoly(mask, [points - np.array([x1, y1], np.int32)], 255)
        blend(surface, mask, (x1, y1), ZONE, _SHADE)
    draw_outline(surface, zone.corners, ZONE, f"{zone.name}: {zone.present}")


def _draw_line(surface: Surface, line: DrawnLine) -> None:
    width = line_width(surface)
    length = math.dist(line.start, line.end)
    tip = min(1.0, _ARROW * surface.shape[0] / length)
    draw_arrow(surface, line.start, line.end, LINE, width, tip=tip)
    across = (line.end[0] - line.start[0]) / length, (line.end[1] - line.start[1]) / length
    to_the_right = -across[1], across[0]
    reach = _ARROW * surface.shape[0]
    for sign, (direction, count) in ((-1, line.left), (1, line.right)):
        dx, dy = sign * reach * to_the_right[0], sign * reach * to_the_right[1]
        tip_at = line.start[0] + dx, line.start[1] + dy
        draw_arrow(surface, line.start, tip_at, LINE, width, tip=0.4)
        _label_beyond(surface, f"{line.name} {direction}: {count}", tip_at, (dx, dy))


def _label_beyond(surface: Surface, text: str, tip: Point, way: Point) -> None:
    """Write a label that begins at the tip of an arrow and lies in its direction."""
    tag = label_tag(surface, text, (0, 0))
    shift = math.hypot(*way) or 1.0
    x = tip[0] + (way[0] / shift - 1) * tag.width / 2
    y = tip[1] + (way[1] / shift + 1) * tag.height / 2
    draw_label(surface, text, (round(x), round(y)), LINE)


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
