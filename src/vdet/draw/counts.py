"""Lines and zones with their counts, drawn into BGR images."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from vdet.draw.boxes import Color, draw_label, label_tag, line_width
from vdet.draw.regions import draw_outline
from vdet.media.images import Image

Point = tuple[float, float]

LINE: Color = (0, 200, 255)
ZONE: Color = (255, 170, 60)
_SHADE = 0.18
"""How much of the colour of a zone covers what is in it."""
_ARROW = 0.035
"""Length of the arrows, share of the image's height."""


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


def draw_counts(image: Image, lines: Sequence[DrawnLine], zones: Sequence[DrawnZone]) -> Image:
    """Draw zones and lines with their counts, and return the image, which is changed.

    A line has an arrow at its end, and on each side an arrow into that direction with its name and
    count.
    """
    for zone in zones:
        _draw_zone(image, zone)
    for line in lines:
        _draw_line(image, line)
    return image


def _draw_zone(image: Image, zone: DrawnZone) -> None:
    points = np.round(np.array(zone.corners)).astype(np.int32)
    x, y, width, height = cv2.boundingRect(points)
    left, top = max(0, x), max(0, y)
    part = image[top : max(0, y + height), left : max(0, x + width)]
    if part.size:
        mask = np.zeros(part.shape[:2], np.uint8)
        cv2.fillPoly(mask, [points - np.array([left, top], np.int32)], 255)
        tint = np.full_like(part, ZONE)
        shaded = np.asarray(cv2.addWeighted(part, 1 - _SHADE, tint, _SHADE, 0), np.uint8)
        part[mask > 0] = shaded[mask > 0]
    draw_outline(image, zone.corners, ZONE, f"{zone.name}: {zone.present}")


def _draw_line(image: Image, line: DrawnLine) -> None:
    width = line_width(image)
    length = math.dist(line.start, line.end)
    tip = min(1.0, _ARROW * image.shape[0] / length)
    cv2.arrowedLine(
        image, _pixel(line.start), _pixel(line.end), LINE, width, cv2.LINE_AA, tipLength=tip
    )
    across = (line.end[0] - line.start[0]) / length, (line.end[1] - line.start[1]) / length
    to_the_right = -across[1], across[0]
    middle = (line.start[0] + line.end[0]) / 2, (line.start[1] + line.end[1]) / 2
    reach = _ARROW * image.shape[0]
    for sign, (direction, count) in ((-1, line.left), (1, line.right)):
        dx, dy = sign * reach * to_the_right[0], sign * reach * to_the_right[1]
        tip_at = middle[0] + dx, middle[1] + dy
        cv2.arrowedLine(
            image, _pixel(middle), _pixel(tip_at), LINE, width, cv2.LINE_AA, tipLength=0.4
        )
        _label_beyond(image, f"{line.name} {direction}: {count}", tip_at, (dx, dy))


def _label_beyond(image: Image, text: str, tip: Point, way: Point) -> None:
    """Write a label that begins at the tip of an arrow and lies in its direction."""
    tag = label_tag(image, text, (0, 0))
    shift = math.hypot(*way) or 1.0
    x = tip[0] + (way[0] / shift - 1) * tag.width / 2
    y = tip[1] + (way[1] / shift + 1) * tag.height / 2
    draw_label(image, text, _pixel((x, y)), LINE)


def _pixel(point: Point) -> tuple[int, int]:
    return round(point[0]), round(point[1])
