"""Lines across the main streams of a video, proposed from the paths of its vehicles.

A stream gets two lines: `in` in the first half of its paths, and `out` in the second half, so that
the flows of a junction follow from them. Both keep away from where vehicles are first and last
seen. Lines are chosen one by one (greedily): each is the one that most vehicles cross which the
lines before do not count.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float64Array, Int64Array
from vdet.polygons import Point
from vdet.traffic.records import VehicleRecord

_LEAST_LENGTH = 1.5
"""Length of the shortest path that counts, in heights of the vehicle's largest box."""
_PARTS = {"in": (0.2, 0.3, 0.4), "out": (0.6, 0.7, 0.8)}
"""Shares of a path at which lines are tried."""
_MOST_TRIED = 150
"""Number of paths along which lines are tried."""
_CLEAR = 0.15
"""Least way from where a vehicle is first or last seen to a line, as a share of its path."""
_GAP = 2.0
"""Largest gap between vehicles that one line counts, in widths of their boxes."""
_MARGIN = 0.5
"""How far a line goes on beyond the outermost vehicle, in widths of their boxes."""
_SAME_WAY = 0.7
"""Least cosine of the angle between the ways of vehicles of one stream."""
_LEAST_SHARE = 0.08
"""Least share of all vehicles that a line counts and no line before it."""
_MOST_LINES = 8
"""Largest number of lines in, and of lines out."""
_SPACING = 0.01
"""Distance of the points of a path, as a share of the frame's width."""
_WORDS = ("right", "down and right", "down", "down and left", "left", "up and left", "up",
          "up and right")  # fmt: skip


@dataclass(frozen=True, slots=True)
class SuggestedLine:
    """A line that a stream crosses to the left of someone who looks from `start` to `end`.

    `vehicles` is how many vehicles it counts that no line before it counts; `way` says in words
    where they go in the picture.
    """

    name: str
    start: Point
    end: Point
    vehicles: int
    way: str


@dataclass(frozen=True, slots=True)
class _Paths:
    """The points of all paths: where, in which direction, of which vehicle, how far along."""

    points: Float64Array
    ways: Float64Array
    numbers: Int64Array
    gone: Float64Array
    lengths: Float64Array
    widths: Float64Array


def suggest_lines(
    records: Sequence[VehicleRecord], width: int, height: int
) -> tuple[SuggestedLine, ...]:
    """Return lines across the main streams, those in before those out, the busiest first.

    `width` and `height` are the size of the frames, pixels.
    """
    moving = [each for each in records if each.length >= _LEAST_LENGTH * each.largest.height]
    if not moving:
        return ()
    paths = _joined(moving, _SPACING * width)
    return tuple(
        line
        for name, shares in _PARTS.items()
        for line in _lines(name, shares, paths, width, height)
    )


def _joined(records: Sequence[VehicleRecord], spacing: float) -> _Paths:
    points, gone = [], []
    for record in records:
        path = np.array(record.path, np.float64)
        along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        at = np.linspace(0, along[-1], max(3, math.ceil(along[-1] / spacing) + 1))
        points.append(np.column_stack([np.interp(at, along, column) for column in path.T]))
        gone.append(at)
    ways = [np.gradient(each, axis=0) for each in points]
    joined = np.concatenate(ways)
    return _Paths(
        np.concatenate(points),
        joined / np.maximum(np.hypot(*joined.T), 1e-9)[:, None],
        np.repeat(np.arange(len(records)), [len(each) for each in points]),
        np.concatenate(gone),
        np.array([each[-1] for each in gone]),
        np.array([float(record.largest.width) for record in records]),
    )


def _lines(
    name: str, shares: Sequence[float], paths: _Paths, width: int, height: int
) -> Iterator[SuggestedLine]:
    """Yield the lines in or out."""
    left = np.ones(len(paths.lengths), np.bool_)
    tried = np.unique(np.linspace(0, len(left) - 1, min(len(left), _MOST_TRIED)).astype(int))
    candidates = [
        _crossing(paths, number, share, name == "in")
        for number in tried.tolist()
        for share in shares
    ]

    def inside(point: Float64Array) -> float:
        return float(min(*point, *((width, height) - point)))

    for number in range(1, _MOST_LINES + 1):
        best = max(candidates, key=lambda each: (left[each.counted].sum(), inside(each.base)))
        count = int(left[best.counted].sum())
        if count < max(1, _LEAST_SHARE * len(left)):
            return
        left[best.counted] = False
        turn = round(math.atan2(best.way[1], best.way[0]) / (math.pi / 4)) % 8
        start, end = best.ends(width, height)
        yield SuggestedLine(f"{name} {number}", start, end, count, _WORDS[turn])


@dataclass(frozen=True, slots=True, eq=False)
class _Crossing:
    """A line through `base` across `way`, from `low` to `high` along it; whom it counts."""

    base: Float64Array
    way: Float64Array
    low: float
    high: float
    counted: Int64Array

    def ends(self, width: int, height: int) -> tuple[Point, Point]:
        along = np.array([-self.way[1], self.way[0]])
        places = [self.base + at * along for at in (self.low, self.high)]
        clipped = np.clip(np.rint(places), 0, (width, height)).tolist()
        return (clipped[0][0], clipped[0][1]), (clipped[1][0], clipped[1][1])


def _crossing(paths: _Paths, number: int, share: float, is_in: bool) -> _Crossing:
    """Return the line across a path at a share of its length."""
    own = np.flatnonzero(paths.numbers == number)
    at = own[np.searchsorted(paths.gone[own], share * paths.lengths[number])]
    base, way = paths.points[at], paths.ways[at]
    across = np.array([-way[1], way[0]])
    ahead, aside = (paths.points - base) @ way, (paths.points - base) @ across
    before = np.flatnonzero(
        (ahead[:-1] < 0)
        & (ahead[1:] >= 0)
        & (paths.numbers[:-1] == paths.numbers[1:])
        & (paths.ways[:-1] @ way >= _SAME_WAY)
    )
    who = paths.numbers[before]
    gone = paths.gone[before] / paths.lengths[who]
    fits = (gone >= _CLEAR) & (gone <= 1 - _CLEAR) & ((gone < 0.5) == is_in)
    before, who = before[fits], who[fits]
    if not len(who):
        return _Crossing(base, way, 0, 0, who)
    order = np.argsort(aside[before])
    who, places = who[order], aside[before][order]
    size = float(np.median(paths.widths[who]))
    parts = np.concatenate([[0], np.cumsum(np.diff(places) > _GAP * size)])
    same = parts == parts[np.argmin(np.abs(places))]
    low, high = places[same][[0, -1]].tolist()
    return _Crossing(base, way, low - _MARGIN * size, high + _MARGIN * size, who[same])
