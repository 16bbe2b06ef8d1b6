"""Lines across the main streams of a video, proposed from the paths of its vehicles.

Vehicles that head the same way at both ends of their paths form a group. The streams of a group are
where a line across the road meets its vehicles side by side. Lines are chosen one by one
(greedily): the one that counts most vehicles of its group that no line counts so far, less all
others that cross it.
"""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import BoolArray, Float64Array, Int64Array
from vdet.polygons import Point, Segment, meeting
from vdet.traffic.linking import VehiclePath

COMPASS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")
"""Directions in which a camera may look."""

_MIN_LENGTH = 1.5
"""Length of the shortest path that counts, in heights of the vehicle's largest box."""
_MIN_VEHICLES = 5
"""Smallest stream that gets a line: vehicles, and as a fraction of all."""
_MIN_FRACTION = 0.08
_MAX_TRIED = 30
"""Number of paths of a group along which lines are tried."""
_PLACES = (0.3, 0.4, 0.5, 0.6, 0.7)
"""Where on a path lines are tried, as fractions of its length."""
_CLEAR = 0.12
"""Smallest way from where a vehicle is first or last seen to a line, as a fraction of its path."""
_GAP = 4.0
"""Largest gap between vehicles of one stream, in heights of their boxes."""
_MARGIN = 0.5
"""How far a line goes on beyond the outermost vehicle, in heights of their boxes."""
_SAME_WAY = 0.7
"""Smallest cosine of the angle between a line's normal and the ways of the vehicles it counts."""
_GROUP = 1.25
"""Distance of groups: of unit vectors of the first and of the last heading, together."""
_MAX_OTHERS = 0.34
"""Largest number of others that cross a line, as a fraction of the vehicles that it is for."""
_NEAR_BEST = 0.9
"""Fraction of the best result from which the place farthest from the ends of paths is taken."""
_SPACING = 0.01
"""Distance of the points of a path, as a fraction of the frame's width."""
_AROUND = 4
"""Number of points before and after one that its way follows from."""
_EDGE = 0.06
"""Smallest distance of the middle of a line from the frame's edge, as a fraction of its side."""
_NAMES = ("north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest")
_WORDS = ("right", "down", "left", "up")
_EAST = 2
"""A quarter of `COMPASS`: what is to the right of where a camera looks."""


@dataclass(frozen=True, slots=True)
class ProposedLine:
    """A line that a stream of `vehicles` crosses to the left of someone who looks along it.

    `left` is the name of the direction of the stream, `right` of the other one. `start` and `end`
    are in pixels.
    """

    name: str
    start: Point
    end: Point
    left: str
    right: str
    vehicles: int


@dataclass(frozen=True, slots=True)
class _Paths:
    """The points of all paths: where, in which direction, of which vehicle, how far along."""

    points: Float64Array
    ways: Float64Array
    numbers: Int64Array
    gone: Float64Array
    heights: Float64Array
    groups: Int64Array


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A line, the numbers of the vehicles it is for and of others that cross it.

    `clear` is its distance from the nearer end of a path, as a fraction of its length.
    """

    ends: Segment
    way: Float64Array
    clear: float
    own: Int64Array
    others: Int64Array

    def gain(self, left: BoolArray, needed: float) -> int:
        """Return how many vehicles it adds to those that are `left`, less all others that cross it.

        It is 0 where these are fewer than `needed`, or others spoil it.
        """
        own = int(left[self.own].sum())
        others = len(self.others) + len(self.own) - own
        return own - others if own >= needed and others <= _MAX_OTHERS * own else 0


def propose_lines(
    paths: Sequence[VehiclePath], width: int, height: int, facing: str | None = None
) -> tuple[ProposedLine, ...]:
    """Return a line across each stream that has enough vehicles, the busiest first.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    facing
        Where the camera looks, one of `COMPASS`; None where that is not known.
    """
    size = width, height
    moving = [each for each in paths if _length(each) >= _MIN_LENGTH * each.heights.max()]
    if len(moving) < _MIN_VEHICLES:
        return ()
    joined = _joined(moving, _SPACING * width)
    candidates = [
        candidate
        for group, count in enumerate(np.bincount(joined.groups).tolist())
        if count >= _MIN_VEHICLES
        for candidate in _candidates(joined, group, size)
    ]
    chosen = list(_chosen(candidates, len(moving)))
    names: Counter[str] = Counter()
    lines = []
    for each, count in sorted(chosen, key=lambda found: -found[1]):
        ahead, back = _directions(each.way, facing)
        names[ahead] += 1
        name = f"{ahead} {names[ahead]}" if names[ahead] > 1 else ahead
        lines.append(ProposedLine(name, *each.ends, ahead, back, count))
    return tuple(lines)


def _length(path: VehiclePath) -> float:
    return math.dist(path.points[0], path.points[path.seen - 1])


def _chosen(candidates: Sequence[_Candidate], vehicles: int) -> Iterator[tuple[_Candidate, int]]:
    """Yield the lines, each with the number of vehicles that no line before it counts."""
    left, needed = np.ones(vehicles, np.bool_), max(_MIN_VEHICLES, _MIN_FRACTION * vehicles)
    while gains := [(gain, each) for each in candidates if (gain := each.gain(left, needed))]:
        best = max(gain for gain, _ in gains)
        line = max(
            (each for gain, each in gains if gain >= _NEAR_BEST * best), key=lambda each: each.clear
        )
        yield line, int(left[line.own].sum())
        left[line.own] = False
        candidates = [each for each in candidates if meeting(each.ends, line.ends) is None]


def _directions(way: Float64Array, facing: str | None) -> tuple[str, str]:
    """Return the names of a direction in the picture and of the opposite one."""
    turn = round(math.atan2(way[1], way[0]) / (math.pi / 2)) % 4
    if facing is None:
        return _WORDS[turn], _WORDS[turn - 2]
    ahead = COMPASS.index(facing) + _EAST * (1 + turn)
    return f"{_NAMES[ahead % 8]}bound", f"{_NAMES[(ahead + 4) % 8]}bound"


def _joined(paths: Sequence[VehiclePath], spacing: float) -> _Paths:
    points, gone, heights = [], [], []
    for path in paths:
        feet, height = path.points[: path.seen], path.heights[: path.seen]
        along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(feet, axis=0).T))])
        at = np.linspace(0, along[-1], max(9, math.ceil(along[-1] / spacing) + 1))
        points.append(np.column_stack([np.interp(at, along, column) for column in feet.T]))
        heights.append(np.interp(at, along, height))
        gone.append(at / along[-1])
    ways = np.concatenate([_ways(each) for each in points])
    return _Paths(
        np.concatenate(points),
        ways / np.maximum(np.hypot(*ways.T), 1e-9)[:, None],
        np.repeat(np.arange(len(paths)), [len(each) for each in points]),
        np.concatenate(gone),
        np.concatenate(heights),
        _groups(points),
    )


def _ways(points: Float64Array) -> Float64Array:
    """Return the ways at points of a path, `(n, 2)`: from some before to some after them."""
    rows = np.arange(len(points))
    return points[np.minimum(rows + _AROUND, rows[-1])] - points[np.maximum(rows - _AROUND, 0)]


def _groups(points: Sequence[Float64Array]) -> Int64Array:
    """Return the number of the group of each path: where it heads first and last."""
    from scipy.cluster.hierarchy import fcluster, linkage

    quarters = [each[[0, len(each) // 4, 3 * len(each) // 4, -1]] for each in points]
    headings = np.diff(quarters, axis=1)[:, [0, 2]]
    headings /= np.maximum(np.linalg.norm(headings, axis=2, keepdims=True), 1e-9)
    tree = linkage(headings.reshape(-1, 4), "average")
    return np.asarray(fcluster(tree, _GROUP, "distance") - 1, np.int64)


def _candidates(paths: _Paths, group: int, size: tuple[int, int]) -> Iterator[_Candidate]:
    members = np.flatnonzero(paths.groups == group)
    tried = np.linspace(0, len(members) - 1, min(len(members), _MAX_TRIED)).astype(int)
    for number in members[np.unique(tried)].tolist():
        rows = np.flatnonzero(paths.numbers == number)
        for place in _PLACES:
            row = int(rows[np.searchsorted(paths.gone[rows], place)])
            shares = paths.points[row] / size
            if (np.abs(shares - 0.5) <= 0.5 - _EDGE).all() and (
                candidate := _across(paths, row, group, size)
            ):
                yield candidate


def _across(paths: _Paths, row: int, group: int, size: tuple[int, int]) -> _Candidate | None:
    """Return the line across a path at one of its points; None where it is for nobody."""
    base, way = paths.points[row], paths.ways[row]
    across = np.array([-way[1], way[0]])
    ahead, aside = (paths.points - base) @ way, (paths.points - base) @ across
    meets = ((ahead[:-1] < 0) != (ahead[1:] < 0)) & (paths.numbers[:-1] == paths.numbers[1:])
    at = np.flatnonzero(meets)
    at = at[np.argsort(aside[at])]
    is_own = (
        (paths.groups[paths.numbers[at]] == group)
        & (paths.ways[at] @ way >= _SAME_WAY)
        & (np.abs(paths.gone[at] - 0.5) <= 0.5 - _CLEAR)
    )
    own, beside = at[is_own], aside[at]
    if not len(own):
        return None
    height = float(np.median(paths.heights[own]))
    parts = np.concatenate([[0], np.cumsum(np.diff(aside[own]) > _GAP * height)])
    own = own[parts == parts[np.argmin(np.abs(aside[own]))]]
    low, high = aside[own[[0, -1]]].tolist()
    margin = _MARGIN * height
    # It ends half the way to the next vehicle of another stream.
    low = max([low - margin, *((low + beside[beside < low]) / 2)])
    high = min([high + margin, *((high + beside[beside > high]) / 2)])
    inside = at[(beside >= low) & (beside <= high)]
    ends = np.clip(np.rint([base + low * across, base + high * across]), 0, size).tolist()
    start, end = ((x, y) for x, y in ends)
    if start == end:
        return None
    who = np.unique(paths.numbers[own])
    clear = 0.5 - abs(float(paths.gone[row]) - 0.5)
    others = np.setdiff1d(paths.numbers[inside], who)
    return _Candidate((start, end), way, clear, who, others)
