"""Which vehicles hide others, and which tracks follow the same vehicle.

On a flat road, nearer vehicles are lower in the image. So of two overlapping vehicles, the one with
the lower bottom hides the other; two overlapping boxes at the same level show one vehicle, because
two would be in the same place.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import BoolArray, Float64Array, coverage, iou_matrix
from vdet.track.motion.pairing import differences
from vdet.track.motion.state import carried
from vdet.track.motion.vehicle import TrackedVehicle

# These limits were set by hand. What half and twice of each does was measured on 41 s of three real
# roads with 38 vehicles: the fraction of the rows of tracks that changes.

_REACH = 0.75
_REACH_GROWTH = 0.35
"""Maximum distance of a lost vehicle from its expected position, in sizes of the vehicle, and its
growth per second that the vehicle was hidden. Half: 5 % of one or two roads. Twice: nothing.
"""

_NEAR = 1.5
"""Maximum distance from a hidden vehicle to one that emerges, in sizes of the vehicle. Half: 5 % of
two roads. Twice: nothing.
"""

_OPPOSED, _UP_AND_DOWN = 0.55, 0.1
"""Minimum product of opposite velocities, in sizes per second, that belong to two vehicles, and the
same for their vertical components: a turning vehicle first changes its horizontal motion. Half and
twice: nothing.
"""

_MAX_UNLIKE = 1.2
"""Maximum difference in appearance between a lost vehicle and a new one that may be the same. Half:
5 % of one road. Twice: nothing.
"""

_GROWTH = 3.0
"""Maximum ratio of the areas of both boxes. Half: 5 % of one road. Twice: nothing."""


PART = 0.6
"""A detection with more than this fraction inside another vehicle is a part of it. Half, or all:
3 to 8 % of each road.
"""

HIDDEN = 0.5
"""A vehicle is hidden if a nearer one covers more than this fraction of it. Half: below 1 %. All:
2 to 6 % of each road.
"""

_LEVEL = 0.15
"""Bottoms that differ by less than this fraction of the smaller height are level. Half: nothing.
Twice: two vehicles of one road become one.
"""

_ALIKE = 0.5
"""Minimum intersection over union of two boxes that show one vehicle, level or not. Half: two
vehicles of one road become one. Never: 3 to 12 % of each road.
"""

_APART = 0.5
"""Seconds for which two tracks may follow one vehicle, which drives away from its track while
detections of its parts still hold that. After them, two tracks with detections are two vehicles,
even if they are level. Half and twice: nothing.
"""

CLEAR = 0.8
"""A detection on a nearer vehicle is a part of that vehicle if it scores less than this fraction.
Half: 5 % of two roads. Always: 3 to 15 % of each.
"""

_DOUBTED = 0.5
"""A detection is not a part of a vehicle that scores less than this fraction of the detection: the
box of that vehicle may span two vehicles that were seen as one. Half: nothing. Twice: 3 % of one
road.
"""


def are_hidden(boxes: Float64Array, present: Sequence[bool]) -> BoolArray:
    """Return for each box whether another one covers more than half of it and is not farther away.

    Parameters
    ----------
    boxes
        Shape `(n, 4)`: x1, y1, x2, y2 in pixels, each with an area.
    present
        Whether each of them can hide others.
    """
    bottoms = boxes[:, 3]
    farther = bottoms < (bottoms - _LEVEL * (bottoms - boxes[:, 1]))[:, np.newaxis]
    hiding = (coverage(boxes, boxes) > HIDDEN) & np.array(present, bool) & ~farther
    np.fill_diagonal(hiding, val=False)
    return np.asarray(hiding.any(axis=1))


def are_parts(boxes: Float64Array, scores: Float64Array) -> BoolArray:
    """Return for each box, `(n, 4)`, whether most of it is inside one with a higher score.

    A vehicle that emerges from behind another one has nearly the same score, and is not a part.

    Returns
    -------
    bool `(n,)`.
    """
    weaker = scores[:, np.newaxis] < CLEAR * scores
    return np.asarray(((coverage(boxes, boxes) > PART) & weaker).any(axis=1))


def take_over_ids(vehicles: Sequence[TrackedVehicle]) -> list[TrackedVehicle]:
    """Pass the ids of lost vehicles to newly confirmed ones at their expected positions.

    A single detection is not enough: a vehicle that is found again is tracked as a new one at
    first.

    Returns
    -------
    The vehicles without the lost ones that were found.
    """
    remaining = list(vehicles)
    for new in vehicles:
        if not new.confirmed or new.unseen or new.id is not None:
            continue
        lost = [v for v in remaining if v.confirmed and v.unseen and _may_be(v, new)]
        if lost:
            nearest = min(lost, key=lambda vehicle: _astray(vehicle, new))
            new.take_over(nearest)
            remaining.remove(nearest)
    return remaining


@dataclass(frozen=True, slots=True)
class _BoxOverlap:
    """How the box of a track overlaps that of another one.

    `inside` is the fraction of it that is inside the other box. `same` says how much the two show
    one vehicle: the fraction of the smaller box inside the other if they are level, 1 if they are
    alike, else 0. `alike` says whether their intersection over union is high.
    """

    inside: float
    same: float
    alike: bool


def without_duplicates(
    vehicles: Sequence[TrackedVehicle], boxes: Float64Array
) -> list[TrackedVehicle]:
    """Keep one track for each vehicle: the one with the highest score, else the oldest one.

    It keeps the id that has not been lost for longer. An unconfirmed track does not replace another
    one; it stays beside it while its score is higher.

    Parameters
    ----------
    boxes
        Their visible parts, x1, y1, x2, y2, `(n, 4)`.
    """
    inside, alike = coverage(boxes, boxes), iou_matrix(boxes, boxes) > _ALIKE
    overlaps = np.maximum(inside, inside.T)
    bottoms, heights = boxes[:, 3], boxes[:, 3] - boxes[:, 1]
    level = abs(bottoms - bottoms[:, None]) < _LEVEL * np.minimum(heights, heights[:, None])
    same = np.where(alike, 1.0, overlaps * level)
    hidden = [vehicle for vehicle in vehicles if vehicle.hidden]
    kept: list[int] = []

    def rank(row: int) -> tuple[bool, float]:
        vehicle = vehicles[row]  # confirmed ones come first; nearly equal ones keep their order
        return not vehicle.confirmed, -round(vehicle.scores.value, 2)

    for row in sorted(range(len(vehicles)), key=rank):
        vehicle = vehicles[row]
        overlapping = [at for at in kept if overlaps[row, at] > PART]
        for at in () if vehicle.unseen else overlapping:
            higher = vehicles[at]
            if higher.unseen or not higher.confirmed:
                continue
            overlap = _BoxOverlap(inside[row, at], same[row, at], alike[row, at])
            if not _show_one_vehicle(vehicle, higher, overlap, hidden):
                continue
            if vehicle.confirmed and min(vehicle.age, higher.age) > _APART:
                vehicle.lose()  # it was apart, and now shows the vehicle that hides its own
                kept.append(row)
            elif vehicle.confirmed:
                higher.merge(vehicle)
            break
        else:  # apart from all of them
            kept.append(row)
    return [vehicles[row] for row in sorted(kept)]


def _show_one_vehicle(
    vehicle: TrackedVehicle,
    higher: TrackedVehicle,
    overlap: _BoxOverlap,
    hidden: Sequence[TrackedVehicle],
) -> bool:
    """Return whether a track shows the vehicle of an overlapping one of higher rank, or a part.

    Both are detected. An unconfirmed track inside the other box may also be one of the `hidden`
    vehicles that emerges, or one of two vehicles that this box spans.
    """
    if min(vehicle.age, higher.age) > _APART:
        return overlap.alike
    if vehicle.confirmed:
        return overlap.same > PART
    if vehicle.scores.value <= higher.scores.value and overlap.same > PART:
        return True
    is_doubted = higher.detection_scores.value < _DOUBTED * vehicle.detection_scores.value
    is_inside = overlap.inside > PART
    return is_inside and not (is_doubted or _comes_out(vehicle, higher, hidden))


def _comes_out(
    vehicle: TrackedVehicle, nearer: TrackedVehicle, hidden: Sequence[TrackedVehicle]
) -> bool:
    """Return whether a `hidden` vehicle was near, and this one is as clear as the nearer one."""
    is_clear = vehicle.detection_scores.value > CLEAR * nearer.detection_scores.value
    position = vehicle.state.mean[:, 0]
    return is_clear and any(_distance(item.state.mean[:, 0], position) < _NEAR for item in hidden)


def _may_be(lost: TrackedVehicle, new: TrackedVehicle) -> bool:
    """Return whether a new vehicle may be the lost one.

    It is at the expected position, looks alike, does not drive the other way, and did not exist
    before.
    """
    beside = lost.history.last_seen.time - new.begin
    if beside >= _APART or _astray(lost, new) >= _REACH + _REACH_GROWTH * lost.hidden:
        return False
    across, down = lost.history.last_seen.state.velocity * new.history.last_seen.state.velocity
    turned = across + down < -_OPPOSED or down < -_UP_AND_DOWN
    return not turned and bool(differences(lost.appearance, new.appearance) < _MAX_UNLIKE)


def _astray(lost: TrackedVehicle, new: TrackedVehicle) -> float:
    """Return the distance of a new vehicle from the expected position of a lost one, in sizes.

    Its current position also counts if only a part may have been seen at first: the lost vehicle
    was hidden, or the first box has another size.
    """
    last, first = lost.history.last_seen, new.history.estimates[0]
    expected = carried(last.state.mean, max(first.time - last.time, 0.0))
    at_first = _distance(expected, new.history.means()[0][:, 0])
    now = _distance(lost.state.mean[:, 0], new.state.mean[:, 0])
    return min(at_first, now) if lost.hidden or math.isinf(at_first) else at_first


def _distance(a: Float64Array, b: Float64Array) -> float:
    """Return the distance of two positions in mean sizes; infinite if the sizes differ too much.

    Parameters
    ----------
    a, b
        Centre x and y and log width and height, `(4,)`.
    """
    if abs(float(np.sum(a[2:] - b[2:]))) > math.log(_GROWTH):
        return math.inf
    sizes = (np.exp(a[2:]) + np.exp(b[2:])) / 2
    return math.hypot(*((a[:2] - b[:2]) / sizes))
