"""Which detection belongs to which vehicle, and which vehicles are the same one.

On a flat road what is nearer stands lower in the picture. So of two vehicles that overlap the one
with the lower bottom hides the other, and two boxes that overlap and stand level are of one
vehicle: two would be in the same place.

Source: the order of the rounds is the matching cascade of Wojke, Bewley and Paulus, "Simple Online
and Realtime Tracking with a Deep Association Metric", 2017; the buffered intersection over union is
that of Yang et al., "Hard to Track Objects with Irregular Motions and Similar Appearances? Make It
Easier by Buffering the Matching Space", 2023.
"""

import math
from collections.abc import Sequence

import numpy as np

from vdet.boxes import BoolArray, Float64Array, coverage, iou, visible
from vdet.track.motion.appearance import differences
from vdet.track.motion.assignment import assign
from vdet.track.motion.vehicle import Vehicle

Pairs = dict[int, int]

WIDEST_BUFFER = 0.25
"""Most that a box is widened by on each side, shares of its size."""

_REACH = 0.75
_REACH_GROWTH = 0.35
"""How far from its expected place a lost vehicle may turn up, in sizes of the vehicle, and how much
farther for each second that it was hidden.
"""

_NEAR = 1.5
"""How far from a hidden vehicle another one may be that comes out, in sizes of the vehicle."""

_OPPOSED, _UP_AND_DOWN = 0.55, 0.1
"""Product of two opposed velocities, in sizes a second, from which on they are of two vehicles, and
the same of their vertical parts: who turns off changes the way across first, but not up and down.
"""

_MOST_UNLIKE = 1.2
"""Largest difference of the appearances of a lost vehicle and of one that may be it."""

_BESIDE = 0.4
"""Seconds for which two tracks may follow one vehicle before the first is lost.

A vehicle may drive away from its track while detections of its parts still hold it.
"""

_BESIDE_UNLIKE = 0.6
"""As `_MOST_UNLIKE`, for two tracks that were there at the same time."""

_GROWTH = 3.0
"""How much larger or smaller its box may be then, as an area."""


PART = 0.6
"""A detection with more than this share inside a shown vehicle is a part of it."""

HIDDEN = 0.5
"""A vehicle is hidden where a nearer one covers more than this share of it."""

_LEVEL = 0.15
"""Bottoms that differ by less than this share of the lesser height are level."""

_LEVEL_OVERLAP = 0.3
"""Share of the smaller of two level boxes that lies in the other, where they are one vehicle."""

_ALIKE = 0.5
"""Intersection over union from which on two boxes are of one vehicle, level or not."""

_APART = 0.5
"""Seconds after which two tracks that both see their vehicles show two, also where they are level.
"""

CLEAR = 0.8
"""A detection on a nearer vehicle that scores less than this share of its score is a part of it."""


def are_hidden(boxes: Float64Array, present: BoolArray) -> BoolArray:
    """Return for each box whether another one covers more than half of it and is not farther.

    Parameters
    ----------
    boxes
        Shape `(n, 4)`: x1, y1, x2, y2 in pixels, each with an area.
    present
        Shape `(n,)`: those that can hide others.
    """
    bottoms = boxes[:, 3]
    farther = bottoms < (bottoms - _LEVEL * (bottoms - boxes[:, 1]))[:, np.newaxis]
    hiding = (coverage(boxes, boxes) > HIDDEN) & present & ~farther
    np.fill_diagonal(hiding, val=False)
    return np.asarray(hiding.any(axis=1))


def is_same(box: Float64Array, other: Float64Array, least: float) -> bool:
    """Return whether two boxes, `(4,)`, show the same vehicle.

    `least` is the share of one that lies in the other, if they are level.
    """
    one, two = box[np.newaxis], other[np.newaxis]
    height = min(box[3] - box[1], other[3] - other[1])
    is_level = abs(other[3] - box[3]) < _LEVEL * height
    overlap = max(coverage(one, two), coverage(two, one))
    return bool(iou(box, other) > _ALIKE or (is_level and overlap > least))


def are_parts(boxes: Float64Array, scores: Float64Array) -> BoolArray:
    """Return for each box, `(n, 4)`, whether most of it lies in one that scores higher.

    A vehicle that comes out from behind another one has nearly the same score, and is no part.

    Returns
    -------
    bool `(n,)`.
    """
    weaker = scores[:, np.newaxis] < CLEAR * scores
    return np.asarray(((coverage(boxes, boxes) > PART) & weaker).any(axis=1))


def is_part(box: Float64Array, other: Float64Array) -> bool:
    """Return whether most of `box`, `(4,)`, lies in `other`."""
    return bool(coverage(box[np.newaxis], other[np.newaxis]) > PART)


def buffered_iou(
    expected: Float64Array, buffers: Float64Array, found: Float64Array
) -> Float64Array:
    """Return how well each expected box fits each found one, 0 to 1, `(n, m)`.

    Both boxes are widened by the buffer of the expected one, in shares of their own sizes. So two
    boxes that do not touch may still belong together where little is known of the motion.

    Parameters
    ----------
    expected, found
        Shapes `(n, 4)` and `(m, 4)`: x1, y1, x2, y2 in pixels, each with an area.
    buffers
        Shape `(n, 2)`: shares of width and height by which a box is widened on each side.
    """
    shares = np.minimum(buffers, WIDEST_BUFFER)[:, np.newaxis]
    return iou(_widened(expected[:, np.newaxis], shares), _widened(found, shares))


def _widened(boxes: Float64Array, shares: Float64Array) -> Float64Array:
    near, far = boxes[..., :2], boxes[..., 2:]
    margin = (far - near) * shares
    return np.concatenate([near - margin, far + margin], axis=-1)


def pair(values: Float64Array, rounds: Sequence[Sequence[int]]) -> Pairs:
    """Pair rows with columns, each at most once.

    Parameters
    ----------
    values
        Shape `(n, m)`: what a pair is worth; 0 where it must not be.
    rounds
        Rows: those of a later round may only have what the earlier ones left.

    Returns
    -------
    The column of each paired row: in each round the pairs with the largest sum of values.
    """
    left = values.copy()
    pairs: Pairs = {}
    for rows in rounds:
        pairs |= {rows[row]: column for row, column in assign(left[list(rows)])}
        left[:, list(pairs.values())] = 0
    return pairs


def take_over_ids(vehicles: Sequence[Vehicle]) -> list[Vehicle]:
    """Give the ids of lost vehicles to those newly confirmed where they should be by then.

    A single detection says too little of what it shows: a vehicle that is found again is followed
    as a new one at first.

    Returns
    -------
    The vehicles without the lost ones that were found.
    """
    left = list(vehicles)
    for new in vehicles:
        if not new.confirmed or new.unseen or new.id is not None:
            continue
        lost = [v for v in left if v.confirmed and v.unseen and _may_be(v, new)]
        if lost:
            nearest = min(lost, key=lambda vehicle: _astray(vehicle, new))
            new.take_over(nearest)
            left.remove(nearest)
    return left


def without_duplicates(vehicles: Sequence[Vehicle], size: tuple[int, int]) -> list[Vehicle]:
    """Leave one track for each vehicle: the one with the highest score, or else the oldest one.

    It keeps the id that was not lost for longer. A track that is not confirmed replaces no other
    one; it stays beside it while its score is higher. Of two tracks that were apart before, the
    weaker one follows the vehicle that hides its own: it is lost.
    """
    boxes = visible(np.reshape([vehicle.state.box for vehicle in vehicles], (-1, 4)), size)
    inside = coverage(boxes, boxes)
    overlaps = np.maximum(inside, inside.T) > _LEVEL_OVERLAP
    hidden = [vehicle for vehicle in vehicles if vehicle.hidden]
    kept: list[int] = []

    def rank(row: int) -> tuple[bool, float]:
        vehicle = vehicles[row]  # confirmed ones come first; nearly equal ones keep their order
        return not vehicle.confirmed, -round(vehicle.scores.value, 2)

    for row in sorted(range(len(vehicles)), key=rank):
        vehicle = vehicles[row]
        for other in kept if not vehicle.unseen else ():
            same = vehicles[other]
            is_shown = overlaps[row, other] and same.confirmed and not same.unseen
            if is_shown and _are_same(vehicle, same, boxes[row], boxes[other], hidden):
                if vehicle.confirmed and min(vehicle.age, same.age) > _APART:
                    vehicle.lose()
                    kept.append(row)
                elif vehicle.confirmed:
                    same.merge(vehicle)
                break
        else:
            kept.append(row)
    return [vehicles[row] for row in sorted(kept)]


def _are_same(
    vehicle: Vehicle,
    other: Vehicle,
    box: Float64Array,
    other_box: Float64Array,
    hidden: Sequence[Vehicle],
) -> bool:
    """Return whether a track shows the same vehicle as another one, higher in rank.

    One that may be a `hidden` vehicle that comes out is no part of the vehicle before it. One
    that has been followed for a while is the same only if most of one lies in the other.
    """
    is_weaker = vehicle.confirmed or vehicle.scores.value <= other.scores.value
    if min(vehicle.age, other.age) > _APART:
        return bool(iou(box, other_box) > _ALIKE)
    is_known = vehicle.confirmed and max(vehicle.age, other.age) > _APART
    if is_weaker and is_same(box, other_box, PART if is_known else _LEVEL_OVERLAP):
        return True
    may_be_part = not vehicle.confirmed and is_part(box, other_box)
    return may_be_part and not _comes_out(vehicle, other, hidden)


def _comes_out(vehicle: Vehicle, nearer: Vehicle, hidden: Sequence[Vehicle]) -> bool:
    """Return whether a `hidden` vehicle was near, and this one is as clear as the nearer."""
    is_clear = vehicle.detection_scores.value > CLEAR * nearer.detection_scores.value
    here = vehicle.state.mean[:, 0]
    return is_clear and any(_distance(each.state.mean[:, 0], here) < _NEAR for each in hidden)


def _may_be(lost: Vehicle, new: Vehicle) -> bool:
    """Return whether a vehicle that is seen again may be the lost one.

    It is where that one should be by then, looks like it, does not drive the other way, and was not
    there before.
    """
    across, down = lost.history.last_velocity * new.history.last_velocity
    turned = across + down < -_OPPOSED or down < -_UP_AND_DOWN
    beside = lost.history.last_seen - new.begin
    unlike = _MOST_UNLIKE if beside < 0 else _BESIDE_UNLIKE
    return (
        beside < _BESIDE
        and not turned
        and bool(differences(lost.appearance, new.appearance) < unlike)
        and _astray(lost, new) < _REACH + _REACH_GROWTH * lost.hidden
    )


def _astray(lost: Vehicle, new: Vehicle) -> float:
    """Return how far from its expected place a lost vehicle is if it is the new one, in sizes.

    Where it is now counts too if only a part was seen first: of one that was hidden, or where the
    first box has another size.
    """
    then = _distance(lost.history.expected(new.history.begin), new.history.first)
    now = _distance(lost.state.mean[:, 0], new.state.mean[:, 0])
    return min(then, now) if lost.hidden or math.isinf(then) else then


def _distance(one: Float64Array, other: Float64Array) -> float:
    """Return the distance of two places in mean sizes; infinite where the sizes do not agree.

    Parameters
    ----------
    one, other
        Centre x and y and log width and height, `(4,)`.
    """
    if abs(float(np.sum(one[2:] - other[2:]))) > math.log(_GROWTH):
        return math.inf
    sizes = (np.exp(one[2:]) + np.exp(other[2:])) / 2
    return math.hypot(*((one[:2] - other[:2]) / sizes))
