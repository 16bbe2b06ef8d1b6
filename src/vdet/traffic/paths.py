"""The picture in which lines are placed: a frame with the paths, pixel coordinates, and lines."""

import colorsys
import math
from collections.abc import Iterable, Sequence

import numpy as np

from vdet.boxes import Image
from vdet.draw.boxes import BLACK, LINE, WHITE, draw_label, draw_line, draw_zone, line_width
from vdet.draw.paint import Color, draw_arrow, draw_lines
from vdet.lanes.ground import Ground
from vdet.polygons import Point
from vdet.traffic.borders import PlacedLine, Zone
from vdet.traffic.records import VehicleRecord

_STEPS = (10, 20, 50, 100, 200, 500, 1000, 2000)
_MOST_LINES = 14
"""Largest number of grid lines across the frame."""
_GRID = 0.3
"""Opacity of the grid."""
_GRID_POINTS = 40
"""Number of points of a line of the grid in metres."""
_LEAST = 0.03
"""Length of the shortest path that is drawn, as a share of the frame's width."""
_WIDEST = 0.012
"""Width of the arrow of the largest flow, as a share of the frame's width."""
_TIP = 0.02
"""Length of the tip of a path, as a share of the frame's width."""


def draw_paths(image: Image, records: Iterable[VehicleRecord]) -> None:
    """Draw the paths of vehicles, each in the colour of its direction, with a tip at its end.

    A dot is where a vehicle was first seen. The arrows at the lower left show the colours.
    """
    height, width = image.shape[:2]
    thin = max(1, line_width(image) // 2)
    for record in records:
        path = _inside(record.path, image)
        if record.share < _LEAST or len(path) < 2:
            continue
        color = direction_color(path[0], path[-1])
        draw_lines(image, path, color, thin)
        draw_lines(image, [path[0], path[0]], color, 4 * thin)
        draw_arrow(image, _tip(path, _TIP * width), path[-1], color, 2 * thin, tip=0.7)
    middle, reach = (0.07 * width, height - 0.07 * width), 0.05 * width
    for angle in np.linspace(0, 2 * math.pi, 8, endpoint=False).tolist():
        end = middle[0] + reach * math.cos(angle), middle[1] + reach * math.sin(angle)
        draw_arrow(image, middle, end, direction_color(middle, end), 2 * thin, tip=0.3)


def draw_flows(image: Image, flows: Sequence[tuple[Sequence[Point], int, Color]]) -> None:
    """Draw an arrow along the path of each flow, as wide as its count says, with the count."""
    most = max((count for _, count, _ in flows), default=1)
    ends = []
    for whole, count, color in sorted(flows, key=lambda flow: -flow[1]):
        if len(path := _inside(whole, image)) > 1:
            width = max(2, round(_WIDEST * image.shape[1] * count / most))
            draw_lines(image, path, color, width)
            tip = _tip(path, 3 * width)
            draw_arrow(image, tip, path[-1], color, width, tip=1)
            ends.append((str(count), path[len(path) // 2], color))
    for text, (x, y), color in ends:
        draw_label(image, text, (x, y), color)


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


def draw_grid(image: Image) -> None:
    """Draw lines at round numbers of pixels, with their coordinates at the top and the left."""
    height, width = image.shape[:2]
    step = next((step for step in _STEPS if width / step <= _MOST_LINES), width)
    grid = image.copy()
    for x in range(step, width, step):
        draw_lines(grid, [(x, 0), (x, height)], WHITE, 1)
    for y in range(step, height, step):
        draw_lines(grid, [(0, y), (width, y)], WHITE, 1)
    image[:] = np.rint(image + (grid.astype(np.float32) - image) * _GRID).astype(np.uint8)
    for x in range(step, width, step):
        draw_label(image, str(x), (x, 0), BLACK)
    for y in range(step, height, step):
        draw_label(image, str(y), (0, y), BLACK)


def draw_ground(image: Image, ground: Ground) -> None:
    """Draw lines at round numbers of metres over the calibrated area, with the metres at its edge.

    The area is outlined.
    """
    draw_lines(image, ground.pixels(ground.area), LINE, line_width(image), closed=True)
    lowest, highest = ground.area.min(axis=0), ground.area.max(axis=0)
    step = next(step for step in (1, 2, 5, 10, 20, 50, 1e9) if ground.length / step <= _MOST_LINES)
    for axis in (0, 1):
        along = np.linspace(lowest[1 - axis], highest[1 - axis], _GRID_POINTS)
        for at in np.arange(math.ceil(lowest[axis] / step) * step, highest[axis] + 1e-6, step):
            points = np.empty((_GRID_POINTS, 2))
            points[:, axis], points[:, 1 - axis] = at, along
            pixels = ground.pixels(points)
            draw_lines(image, pixels, WHITE, 1)
            x, y = pixels[0].tolist()
            draw_label(image, f"{at:g} m", (x, y), BLACK)


def draw_places(image: Image, lines: Sequence[PlacedLine], zones: Sequence[Zone]) -> None:
    """Draw lines with their names and the names of both sides, and zones with their names."""
    for zone in zones:
        draw_zone(image, zone.corners, zone.name)
    for line in lines:
        left, right = (
            side if way == side else f"{side}: {way}"
            for side, way in zip(("left", "right"), line.directions, strict=True)
        )
        draw_line(image, line.start, line.end, (f"{line.name} {left}", right))
