"""Points, segments and polygons in a picture: x to the right, y down, in any unit."""

import math
from collections.abc import Sequence
from itertools import combinations

Point = tuple[float, float]
Segment = tuple[Point, Point]


def side_of(start: Point, end: Point, point: Point) -> float:
    """Return the distance of a point from the line through `start` and `end`.

    It is positive on the right of someone who looks from `start` to `end`, negative on the left.
    """
    (ax, ay), (bx, by), (x, y) = start, end, point
    return ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / math.hypot(bx - ax, by - ay)


def meeting(path: Segment, segment: Segment) -> float | None:
    """Return the share of the way along `path` at which it meets a segment; None where it does not.

    Both include their ends. Where they run along one another, it is None.
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


def distance_to(segment: Segment, point: Point) -> float:
    """Return the distance of a point from the nearest point of a segment."""
    (ax, ay), (bx, by) = segment
    ux, uy = bx - ax, by - ay
    length = ux * ux + uy * uy
    share = ((point[0] - ax) * ux + (point[1] - ay) * uy) / length if length else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.hypot(point[0] - ax - share * ux, point[1] - ay - share * uy)


def sides(corners: Sequence[Point]) -> list[Segment]:
    """Return the sides of a polygon; the last one leads back to the first corner."""
    return [(corners[i - 1], corner) for i, corner in enumerate(corners)]


def crosses_itself(corners: Sequence[Point]) -> bool:
    """Tell whether two sides of a polygon have more in common than a corner between neighbours.

    A polygon without an area does.
    """
    if len(set(corners)) < len(corners):
        return True
    return any(_touch(first, second) for first, second in combinations(sides(corners), 2))


def _touch(first: Segment, second: Segment) -> bool:
    """Tell whether two sides have more in common than a corner."""
    common = set(first) & set(second)
    ends = [(first, point) for point in second] + [(second, point) for point in first]
    if any(point not in common and distance_to(side, point) == 0 for side, point in ends):
        return True
    return not common and meeting(first, second) is not None


def contains(corners: Sequence[Point], point: Point) -> bool:
    """Tell whether a point lies in a polygon; one on a side may count as in or out.

    It is in where a ray from it meets an odd number of sides (Shimrat 1962).
    """
    x, y = point
    inside = False
    for (ax, ay), (bx, by) in sides(corners):
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside
