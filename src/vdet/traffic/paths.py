"""The picture in which lines are placed: a frame with the paths, pixel coordinates, and lines."""

import colorsys
import math
from collections.abc import Iterable, Sequence

from vdet.boxes import Image
from vdet.draw.boxes import line_width
from vdet.draw.paint import Color, draw_arrow, draw_lines
from vdet.polygons import Point
from vdet.traffic.records import VehicleRecord

_MINIMUM = 0.03
"""Length of the shortest path that is drawn, as a fraction of the frame's width."""
_TIP = 0.02
"""Length of the tip of a path, as a fraction of the frame's width."""


def draw_paths(image: Image, records: Iterable[VehicleRecord]) -> None:
    """Draw the paths of vehicles, each in the colour of its direction, with a tip at its end.

    A dot is where a vehicle was first seen.
    """
    width = image.shape[1]
    thin = max(1, line_width(image) // 2)
    for record in records:
        path = _inside(record.path, image)
        if record.share < _MINIMUM or len(path) < 2:
            continue
        color = direction_color(path[0], path[-1])
        draw_lines(image, path, color, thin)
        draw_lines(image, [path[0], path[0]], color, 4 * thin)
        draw_arrow(image, _tip(path, _TIP * width), path[-1], color, 2 * thin, tip=0.7)


def _inside(path: Sequence[Point], image: Image) -> list[Point]:
    """Return the points of a path that lie in the picture."""
    height, width = image.shape[:2]
    return [(x, y) for x, y in path if 0 <= x < width and 0 <= y < height]


def _tip(path: Sequence[Point], length: float) -> Point:
    """Return where the tip of a path begins: so far before its end."""
    end = path[-1]
    back = next((point for point in reversed(path) if math.dist(point, end) >= length), path[0])
    share = length / max(length, math.dist(back, end))
    return end[0] + share * (back[0] - end[0]), end[1] + share * (back[1] - end[1])


def direction_color(start: Point, end: Point) -> Color:
    """Return the colour of the direction from one point to another."""
    angle = math.atan2(end[1] - start[1], end[0] - start[0])
    red, green, blue = colorsys.hsv_to_rgb(angle / (2 * math.pi) % 1, 0.8, 1)
    return round(255 * blue), round(255 * green), round(255 * red)
