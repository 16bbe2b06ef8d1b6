"""Proposed lines across the main streams of a video, from the paths of its vehicles.

Vehicles with the same headings at both ends of their paths form a group. A stream is the part of a
group that crosses a line across the road side by side. Lines are chosen greedily: the next is the
one that counts most vehicles of its group that are not counted yet, minus all others that cross it.
"""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import BoolArray, Float64Array, Int64Array
from vdet.polygons import Point, Segment, meeting
from vdet.traffic.linking import VehiclePath

_MIN_LENGTH = 1.5
"""Minimum length of a path, in heights of the vehicle's largest box."""
_MIN_VEHICLES, _MIN_FRACTION = 5, 0.08
"""Minimum vehicles of a stream that gets a line: their number, and as a fraction of all."""
_MAX_TRIED = 30
"""Maximum number of paths of a group along which lines are tried."""
_FRACTIONS = (0.5, 0.4, 0.6, 0.3, 0.7)
"""Where lines are tried along a path, as fractions of its length; the first ones are better."""
_MIN_FROM_END = 0.12
"""Minimum distance of a line from both ends of a path, as a fraction of its length."""
_MAX_GAP, _MARGIN = 4.0, 0.5
"""Maximum gap between vehicles of a stream, and length of a line beyond the outermost one, in
heights of their boxes.
"""
_MIN_COSINE = 0.7
"""Minimum cosine of the angle between the normal of a line and the heading of a vehicle."""
_GROUP_DISTANCE = 1.25
"""Distance between groups: of the unit vectors of the first and the last heading, together."""
_MAX_OTHERS = 0.34
"""Maximum number of other vehicles that cross a line, as a fraction of its own."""
_NEAR_BEST = 0.9
"""Fraction of the maximum gain at which a better position along the path is preferred."""
_SPACING, _AROUND = 0.01, 4
"""Distance of the points of a path, as a fraction of the frame's width; number of points before and
after a point from which its heading follows.
"""
_WORDS = ("right", "down", "left", "up")
_NAMES = ("north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest")
COMPASS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")
"""Directions in which a camera can look."""


@dataclass(frozen=True, slots=True)
class ProposedLine:
    """A line that a stream of `vehicles` crosses to the left, seen from `start` to `end`, pixels.

    `left` is the name of the stream's direction, `right` that of the opposite one.
    """

    name: str
    start: Point
    end: Point
    left: str
    right: str
    vehicles: int


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A line across a `heading`, the vehicles of its stream, and others that cross it (indices).

    `rank` is the index in `_FRACTIONS` of its position on a path.
    """

    ends: Segment
    heading: Float64Array
    rank: int
    stream: Int64Array
    others: Int64Array

    def gain(self, uncounted: BoolArray) -> int:
        """Return the number of `uncounted` vehicles of its stream, minus all others; 0 if few."""
        gained = int(uncounted[self.stream].sum())
        others = len(self.others) + len(self.stream) - gained
        is_enough = gained >= max(_MIN_VEHICLES, _MIN_FRACTION * len(uncounted))
        return gained - others if is_enough and others <= _MAX_OTHERS * gained else 0


def propose_lines(
    paths: Sequence[VehiclePath], width: int, height: int, facing: str | None = None
) -> tuple[ProposedLine, ...]:
    """Return a line across each stream that has enough vehicles, the busiest first.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    facing
        Direction of the camera, one of `COMPASS`; None if unknown.
    """
    moving = [
        path
        for path in paths
        if math.dist(path.points[0], path.points[path.seen - 1]) >= _MIN_LENGTH * path.heights.max()
    ]
    if len(moving) < _MIN_VEHICLES:
        return ()
    candidates = list(_Streams(moving, width, height).candidates())
    uncounted, lines, names = np.ones(len(moving), np.bool_), [], Counter[str]()
    while gains := [(gain, item) for item in candidates if (gain := item.gain(uncounted))]:
        best = max(gain for gain, _ in gains)
        good = (item for gain, item in gains if gain >= _NEAR_BEST * best)
        line = min(good, key=lambda item: item.rank)
        ahead, back = _directions(line.heading, facing)
        names[ahead] += 1
        name = f"{ahead} {names[ahead]}" if names[ahead] > 1 else ahead
        vehicles = int(uncounted[line.stream].sum())
        start, end = line.ends
        lines.append(ProposedLine(name, start, end, left=ahead, right=back, vehicles=vehicles))
        uncounted[line.stream] = False
        candidates = [item for item in candidates if meeting(item.ends, line.ends) is None]
    return tuple(lines)


def _directions(heading: Float64Array, facing: str | None) -> tuple[str, str]:
    """Return the names of the direction of a heading and of the opposite direction."""
    turn = round(math.atan2(heading[1], heading[0]) / (math.pi / 2)) % 4
    if facing is None:
        return _WORDS[turn], _WORDS[turn - 2]
    ahead = COMPASS.index(facing) + 2 * (1 + turn)
    return f"{_NAMES[ahead % 8]}bound", f"{_NAMES[(ahead + 4) % 8]}bound"


@dataclass(frozen=True, slots=True, eq=False)
class _Stream:
    """The vehicles of a group that cross a line side by side.

    `vehicles` are their indices, `low` and `high` the outermost positions along the line, and
    `height` is the median height of their boxes, pixels.
    """

    vehicles: Int64Array
    low: float
    high: float
    height: float

    def limits(self, positions: Float64Array) -> tuple[float, float]:
        """Return the ends of its line; it ends halfway to the next vehicle of another stream.

        `positions` are those of all vehicles that cross the line.
        """
        margin = _MARGIN * self.height
        before, after = positions[positions < self.low], positions[positions > self.high]
        low = max([self.low - margin, *((self.low + before) / 2)])
        high = min([self.high + margin, *((self.high + after) / 2)])
        return low, high


class _Streams:
    """The points of all paths: position, heading, vehicle, group, and fraction of the path."""

    def __init__(self, paths: Sequence[VehiclePath], width: int, height: int) -> None:
        rows = [_spaced(path, _SPACING * width) for path in paths]
        self._size = width, height
        self._numbers = np.repeat(np.arange(len(paths)), [len(row) for row in rows])
        joined = np.concatenate(rows)
        self._points, self._headings = joined[:, :2], joined[:, 2:4]
        self._heights, self._fractions = joined[:, 4:].T
        self._groups = _groups(rows)[self._numbers]

    def candidates(self) -> Iterator[_Candidate]:
        for group in range(self._groups.max() + 1):
            members = np.unique(self._numbers[self._groups == group])
            tried = np.linspace(0, len(members) - 1, min(len(members), _MAX_TRIED)).astype(int)
            for number in members[tried].tolist():
                rows = np.flatnonzero(self._numbers == number)
                for rank, fraction in enumerate(_FRACTIONS):
                    row = int(rows[np.searchsorted(self._fractions[rows], fraction)])
                    if candidate := self._across(row, rank):
                        yield candidate

    def _across(self, row: int, rank: int) -> _Candidate | None:
        """Return the line across a path at one of its points; None if it counts no vehicle."""
        base, heading, numbers = self._points[row], self._headings[row], self._numbers
        across = np.array([-heading[1], heading[0]])
        is_behind = (self._points - base) @ heading < 0
        positions = (self._points - base) @ across
        rows = np.flatnonzero((is_behind[:-1] != is_behind[1:]) & (numbers[:-1] == numbers[1:]))
        rows = rows[np.argsort(positions[rows])]  # where a path crosses the infinite line
        if (stream := self._stream(row, rows, positions[rows])) is None:
            return None
        low, high = stream.limits(positions[rows])
        ends = np.clip(np.rint([base + low * across, base + high * across]), 0, self._size)
        start, end = map(tuple, ends.tolist())
        if start == end:
            return None
        is_crossing = (positions[rows] >= low) & (positions[rows] <= high)
        others = np.setdiff1d(numbers[rows[is_crossing]], stream.vehicles)
        return _Candidate((start, end), heading, rank, stream.vehicles, others)

    def _stream(self, row: int, rows: Int64Array, positions: Float64Array) -> _Stream | None:
        """Return the stream of the path at `row`, of the `rows` of all that cross its line."""
        is_member = (
            (self._groups[rows] == self._groups[row])
            & (self._headings[rows] @ self._headings[row] >= _MIN_COSINE)
            & (np.abs(self._fractions[rows] - 0.5) <= 0.5 - _MIN_FROM_END)
        )
        if not is_member.any():
            return None
        members, offsets = rows[is_member], positions[is_member]
        height = float(np.median(self._heights[members]))
        parts = np.concatenate([[0], np.cumsum(np.diff(offsets) > _MAX_GAP * height)])
        is_beside = parts == parts[np.argmin(np.abs(offsets))]
        vehicles = np.unique(self._numbers[members[is_beside]])
        low, high = offsets[is_beside][[0, -1]].tolist()
        return _Stream(vehicles, low, high, height)


def _spaced(path: VehiclePath, spacing: float) -> Float64Array:
    """Return points of a path: x, y, heading x and y, height, fraction of the length: `(n, 6)`."""
    points, heights = path.points[: path.seen], path.heights[: path.seen]
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    at = np.linspace(0, along[-1], max(9, math.ceil(along[-1] / spacing) + 1))
    x, y, height = (np.interp(at, along, values) for values in (*points.T, heights))
    rows = np.arange(len(at))
    after, before = np.minimum(rows + _AROUND, rows[-1]), np.maximum(rows - _AROUND, 0)
    headings = np.array([x[after] - x[before], y[after] - y[before]])
    headings /= np.maximum(np.hypot(*headings), 1e-9)
    return np.column_stack([x, y, *headings, height, at / along[-1]])


def _groups(rows: Sequence[Float64Array]) -> Int64Array:
    """Return the number of the group of each path, by its first and last heading."""
    from scipy.cluster.hierarchy import fcluster, linkage

    quarters = [row[[0, len(row) // 4, 3 * len(row) // 4, -1], :2] for row in rows]
    headings = np.diff(quarters, axis=1)[:, [0, 2]]
    headings /= np.maximum(np.linalg.norm(headings, axis=2, keepdims=True), 1e-9)
    tree = linkage(headings.reshape(-1, 4), "average")
    return np.asarray(fcluster(tree, _GROUP_DISTANCE, "distance") - 1, np.int64)
