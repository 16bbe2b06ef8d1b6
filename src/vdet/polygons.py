"""Points, segments and polygons in a picture: x to the right, y down, in any unit."""

import math
from collections.abc import Sequence

Point = tuple[float, float]
Segment = tuple[Point, Point]


def side_of(start: Point, end: Point, point: Point) -> float:
    """Return the distance of a point from the line through `start` and `end`.

    It is positive to the right, as seen from `start` towards `end`, and negative to the left.
    """
    (ax, ay), (bx, by), (x, y) = start, end, point
    return ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / math.hypot(bx - ax, by - ay)


def meeting(path: Segment, segment: Segment) -> float | None:
    """Return where a path meets a segment, as a fraction of the path's length.

    Both include their ends. None if they do not meet, or overlap.
    """
    (ax, ay), (bx, by) = path
    (cx, cy), (dx, dy) = segment
    ux, uy, vx, vy = bx - ax, by - ay, dx - cx, dy - cy
    area = ux * vy - uy * vx
    if area == 0:
        return None
    along = ((cx - ax) * vy - (cy - ay) * vx) / area
    across = ((cx - ax) * uy - (cy - ay) * ux) / area
    return along if 0 <= along <= 1 and 0 <= across <= 1 else None


def sides(corners: Sequence[Point]) -> list[Segment]:
    """Return the sides of a polygon; the last one leads back to the first corner."""
    return [(corners[i - 1], corner) for i, corner in enumerate(corners)]
