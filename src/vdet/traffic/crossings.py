"""What a vehicle does at a line or zone, from its whole path. `vdet.traffic` explains the rule."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from vdet.boxes import BoolArray, Float64Array
from vdet.polygons import Point
from vdet.traffic.borders import APPEAR, EXIT, VANISH, Border, Zone
from vdet.traffic.linking import DURATION_DIGITS, VehiclePath

_SETTLED = 0.1
"""Seconds after which a vehicle off a border's band has changed the side."""
_BAND = 0.05
"""Distance from a border within which a vehicle is on neither side, in heights of its box."""
_LEAST_BAND = 0.003
"""Smallest such distance, as a fraction of the frame's height."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """A vehicle crosses a line, or enters, leaves, appears in or vanishes from a zone.

    Attributes
    ----------
    time
        Seconds, interpolated between two rows of the path.
    row
        Number of the first row of the path at or after it.
    direction
        As of `Event`.
    seconds
        How long the vehicle was in the zone, for exit and vanish; else None.
    """

    time: float
    row: int
    direction: str
    seconds: float | None = None


def crossings(path: VehiclePath, border: Border) -> list[Crossing]:
    """Return what a vehicle does at a border, in order; it depends on nothing but the arguments."""
    found = list(_changes(path, border))
    if not isinstance(border, Zone) or not found:
        return found
    visits = found[:1]
    for before, item in pairwise(found):
        stay = item.time - before.time if item.direction == EXIT else None
        visits.append(replace(item, seconds=stay))
    last = path.seen - 1
    if found[-1].direction != EXIT:
        end = max(float(path.times[last]), found[-1].time)  # it may enter where it drives on
        visits.append(Crossing(end, last, VANISH, end - found[-1].time))
    return visits


def _changes(path: VehiclePath, border: Border) -> Iterator[Crossing]:
    """Yield the changes of the settled side, and where it begins in a zone."""
    distances = border.distances(path.points)
    side = distances >= 0
    turns = (np.flatnonzero(side[1:] != side[:-1]) + 1).tolist()
    if not turns and not (side[0] and isinstance(border, Zone)):
        return  # as for most paths
    settles, is_clear = _settling(path, border, distances)
    settled: bool | None = None  # the side
    crossed: Point | None = None  # where it crossed last
    for row, end in pairwise([0, *turns, len(side)]):
        is_positive, rows = bool(side[row]), row + np.flatnonzero(settles[row:end])
        if not len(rows) or settled == is_positive:
            continue
        if settled is not None:
            share, time, place = _meeting(path, border, row)
            way = math.inf if crossed is None else math.dist(crossed, place)
            if not (is_clear[rows] | (path.heights[rows] <= way)).any():
                continue  # a way back that is too short
            crossed = None if share is None else place
            if share is not None:
                yield Crossing(time, row if share else row - 1, border.directions[1 - is_positive])
        elif is_positive and isinstance(border, Zone):
            yield Crossing(float(path.times[0]), 0, APPEAR)
        settled = is_positive


def _settling(
    path: VehiclePath, border: Border, distances: Float64Array
) -> tuple[BoolArray, BoolArray]:
    """Return the rows that settle the side on which they are, and those in which it is clear.

    It is clear where this row or the one before shows it one height of the box away.
    """
    side, away, times = distances >= 0, np.abs(distances), path.times
    is_off = away > np.maximum(_BAND * path.heights, _LEAST_BAND * border.size[1])
    is_far = is_off & (away >= path.heights)
    is_same = side[1:] == side[:-1]
    was_far = np.append(False, is_far[:-1] & is_same)
    begins = np.append(True, ~(is_off[1:] & is_off[:-1] & is_same))
    since = times[np.maximum.accumulate(np.where(begins, np.arange(len(times)), 0))]
    settles = was_far | (is_off & (np.round(times - since, DURATION_DIGITS) >= _SETTLED))
    settles[-1] |= is_far[-1]
    return settles, is_far | was_far


def _meeting(path: VehiclePath, border: Border, row: int) -> tuple[float | None, float, Point]:
    """Return where a path meets a border between a row and the one before: share, time, place."""
    (ax, ay), (bx, by) = path.points[row - 1 : row + 1].tolist()
    before, after = path.times[row - 1 : row + 1].tolist()
    share = border.meeting(((ax, ay), (bx, by)))
    along = 1.0 if share is None else share
    place = ax + along * (bx - ax), ay + along * (by - ay)
    return share, before + along * (after - before), place
