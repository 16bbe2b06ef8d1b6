"""Which vehicles are one and the same."""

import math
from collections.abc import Sequence

import numpy as np

from vdet.config.schema import MotionTrackerSettings
from vdet.geometry import visible
from vdet.track.motion.overlapping import is_part, is_same
from vdet.track.motion.vehicle import Vehicle

_REACH = 1.5
"""How far from its expected place a lost vehicle may turn up, in sizes of the vehicle."""

_GROWTH = 3.0
"""How much larger or smaller its box may be then, as an area."""


def take_over_ids(vehicles: Sequence[Vehicle]) -> list[Vehicle]:
    """Give the ids of vehicles that were lost to those newly confirmed near by; return the rest.

    Behind another vehicle a prediction goes astray, and what turns up beside it is followed as a
    new one at first.
    """
    left = list(vehicles)
    for new in vehicles:
        if not new.confirmed or new.id is not None or new.misses:
            continue
        lost = [v for v in left if v.id is not None and v.misses and _distance(v, new) < _REACH]
        if lost:
            nearest = min(lost, key=lambda vehicle: _distance(vehicle, new))
            new.id = nearest.id
            left.remove(nearest)
    return left


def without_duplicates(
    vehicles: Sequence[Vehicle], size: tuple[int, int], settings: MotionTrackerSettings
) -> list[Vehicle]:
    """Drop vehicles that a surer one accounts for; of equally sure ones the older stays."""
    kept: list[Vehicle] = []
    for vehicle in sorted(vehicles, key=lambda v: (not v.confirmed, -v.evidence)):
        seen = [v.state.box for v in kept if v.confirmed and not v.misses]
        if vehicle.misses == 0 and seen:
            box, *others = visible(np.stack([vehicle.state.box, *seen]), size)
            inside = not vehicle.confirmed and is_part(box, np.stack(others), settings.part)
            if inside or is_same(box, np.stack(others)):
                continue
        kept.append(vehicle)
    return [vehicle for vehicle in vehicles if vehicle in kept]


def _distance(one: Vehicle, other: Vehicle) -> float:
    """Return the distance of the centres in mean sizes; infinite where the sizes do not agree."""
    a, b = one.state.box, other.state.box
    if abs(math.log(a[2] * a[3] / (b[2] * b[3]))) > math.log(_GROWTH):
        return math.inf
    offset = (a[:2] + a[2:] / 2 - b[:2] - b[2:] / 2) / ((a[2:] + b[2:]) / 2)
    return math.hypot(*offset)
