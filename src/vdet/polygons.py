"""Points, segments and polygons in a picture: x to the right, y down, in any unit."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

Point = tuple[float, float]
Segment = tuple[Point, Point]

_AT_EDGE = 0.002
"""A corner within this share of the frame's side (or one pixel) of the frame's edge lies on it."""
_INSIDE = 0.01
"""Pixels from the edge of the frame to which points outside are moved."""


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


def unclosed(corners: Sequence[Point]) -> tuple[Point, ...]:
    """Return the corners without the last one where it only repeats the first."""
    closed = len(corners) > 1 and corners[0] == corners[-1]
    return tuple(corners[:-1] if closed else corners)


def crosses_itself(corners: Sequence[Point]) -> bool:
    """Tell whether two sides of a polygon have more in common than a corner between neighbours."""
    if len(set(corners)) < len(corners):
        return True
    count, all_sides = len(corners), sides(corners)
    for (i, first), (j, second) in combinations(enumerate(all_sides), 2):
        if j - i == 1 or (i == 0 and j == count - 1):
            if _turns_back(first, second):
                return True
        elif _touch(first, second):
            return True
    return False


def area_of(corners: Sequence[Point]) -> float:
    """Return the area of a polygon that does not cross itself."""
    return abs(sum(ax * by - bx * ay for (ax, ay), (bx, by) in sides(corners))) / 2


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


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _turns_back(first: Segment, second: Segment) -> bool:
    """Tell whether two sides with a common end run along one another."""
    (common,) = set(first) & set(second)
    (a,), (b,) = set(first) - {common}, set(second) - {common}
    ahead = (a[0] - common[0]) * (b[0] - common[0]) + (a[1] - common[1]) * (b[1] - common[1])
    return _turn(common, a, b) == 0 and ahead > 0


def _touch(first: Segment, second: Segment) -> bool:
    if meeting(first, second) is not None:
        return True
    ends = [(first, point) for point in second] + [(second, point) for point in first]
    return any(distance_to(segment, point) == 0 for segment, point in ends)


@dataclass(frozen=True, slots=True)
class Outline:
    """A polygon laid over a frame; where it ends at the frame's edge, it goes on beyond.

    Attributes
    ----------
    corners
        Pixels of the frame.
    borders
        The sides that do not run along the frame's edge.
    size
        Width and height of the frame.
    """

    corners: tuple[Point, ...]
    borders: tuple[Segment, ...]
    size: tuple[float, float]

    @staticmethod
    def laid(corners: Sequence[Point], size: tuple[float, float]) -> "Outline":
        """Lay a polygon over a frame; corners very near the frame's edge move onto it."""
        snapped = tuple(snapped_to_edge(corner, size) for corner in corners)
        borders = tuple(each for each in sides(snapped) if not _runs_along_edge(each, size))
        return Outline(snapped, borders, size)

    def contains(self, point: Point) -> bool:
        """Tell whether a point lies in it; one outside the frame counts as at its edge."""
        return contains(self.corners, self._in_frame(point))

    def distance(self, point: Point) -> float:
        """Return the distance of a point from the borders: positive inside, negative outside.

        It is infinite where there is no border.
        """
        inside = self._in_frame(point)
        distance = min((distance_to(each, inside) for each in self.borders), default=math.inf)
        return distance if contains(self.corners, inside) else -distance

    def meeting(self, path: Segment) -> float | None:
        """Return the share of the way along `path` at which it last meets a border, if it does."""
        start, end = path
        inside = self._in_frame(start), self._in_frame(end)
        shares = [share for each in self.borders if (share := meeting(inside, each)) is not None]
        return max(shares, default=None)

    def _in_frame(self, point: Point) -> Point:
        width, height = self.size
        return (
            min(max(point[0], _INSIDE), width - _INSIDE),
            min(max(point[1], _INSIDE), height - _INSIDE),
        )


def snapped_to_edge(point: Point, size: tuple[float, float]) -> Point:
    """Return a point, moved onto the frame's edge where it is very near to it."""
    x, y = (_snapped(value, length) for value, length in zip(point, size, strict=True))
    return x, y


def at_edge(point: Point, size: tuple[float, float]) -> bool:
    """Tell whether a point lies on the frame's edge."""
    return any(value in (0, length) for value, length in zip(point, size, strict=True))


def _snapped(value: float, length: float) -> float:
    near = max(1.0, _AT_EDGE * length)
    if value <= near:
        return 0.0
    return float(length) if length - value <= near else value


def _runs_along_edge(segment: Segment, size: tuple[float, float]) -> bool:
    return any(
        start == end and start in (0, length)
        for start, end, length in zip(*segment, size, strict=True)
    )
