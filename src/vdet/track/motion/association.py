"""Which detection belongs to which vehicle, and which vehicles are the same one.

Source: the order of the rounds is the matching cascade of Wojke, Bewley and Paulus, "Simple Online
and Realtime Tracking with a Deep Association Metric", 2017; the buffered intersection over union is
that of Yang et al., "Hard to Track Objects with Irregular Motions and Similar Appearances? Make It
Easier by Buffering the Matching Space", 2023.
"""

import math
from collections.abc import Sequence

import numpy as np

from vdet.boxes import Float64Array, area, iou, visible
from vdet.track.motion.assignment import assign
from vdet.track.motion.overlapping import CLEAR, PART, is_part, is_same
from vdet.track.motion.vehicle import Vehicle

Pairs = dict[int, int]

WIDEST_BUFFER = 0.5
"""Most that a box is widened by on each side, shares of its size."""

_REACH = 1.5
"""How far from its expected place a lost vehicle may turn up, in sizes of the vehicle."""

_GROWTH = 3.0
"""How much larger or smaller its box may be then, as an area."""


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
    """Give the ids of lost vehicles to those newly confirmed near by; return the others.

    Behind another vehicle a prediction goes astray, and the vehicle that appears beside it is
    followed as a new one at first.
    """
    left = list(vehicles)
    for new in vehicles:
        if not new.confirmed or new.id is not None or new.unseen:
            continue
        lost = [v for v in left if v.id is not None and v.unseen and _distance(v, new) < _REACH]
        if lost:
            nearest = min(lost, key=lambda vehicle: _distance(vehicle, new))
            new.id = nearest.id
            left.remove(nearest)
    return left


def without_duplicates(vehicles: Sequence[Vehicle], size: tuple[int, int]) -> list[Vehicle]:
    """Leave one track for each vehicle: the one with the highest score, or else the oldest one.

    It takes the lowest id of those dropped. A track that is not confirmed replaces no other one; it
    stays beside it while its score is higher.
    """
    kept: list[Vehicle] = []
    hidden = [vehicle for vehicle in vehicles if vehicle.hidden]
    for vehicle in sorted(vehicles, key=_rank):
        same = _track_of_same(vehicle, kept, hidden, size)
        if same is None:
            kept.append(vehicle)
        elif vehicle.id is not None:
            same.id = vehicle.id if same.id is None else min(same.id, vehicle.id)
    return [vehicle for vehicle in vehicles if vehicle in kept]


def _rank(vehicle: Vehicle) -> tuple[bool, float]:
    """Sort confirmed vehicles first, then by score; nearly equal scores keep their order."""
    return not vehicle.confirmed, -round(vehicle.score, 2)


def _track_of_same(
    vehicle: Vehicle,
    others: Sequence[Vehicle],
    hidden: Sequence[Vehicle],
    size: tuple[int, int],
) -> Vehicle | None:
    """Return the track among `others`, higher in rank, that shows the same vehicle.

    One that may be a `hidden` vehicle that comes out is no part of the vehicle before it.
    """
    if vehicle.unseen:
        return None
    for other in others:
        if not other.confirmed or other.unseen:
            continue
        boxes = visible(np.stack([vehicle.state.box, other.state.box]), size)
        weaker = vehicle.confirmed or vehicle.score <= other.score
        inside = not vehicle.confirmed and is_part(boxes[0], boxes[1:], PART)
        part = inside and not _comes_out(vehicle, other, hidden)
        if part or (weaker and is_same(boxes[0], boxes[1:])):
            return other
    return None


def _comes_out(vehicle: Vehicle, nearer: Vehicle, hidden: Sequence[Vehicle]) -> bool:
    """Tell whether one of the `hidden` vehicles was near and this one is as clear as the nearer."""
    is_clear = vehicle.detection_score > CLEAR * nearer.detection_score
    return is_clear and any(_distance(each, vehicle) < _REACH for each in hidden)


def _distance(one: Vehicle, other: Vehicle) -> float:
    """Return the distance of the centres in mean sizes; infinite where the sizes do not agree."""
    a, b = one.state.box, other.state.box
    if abs(math.log(area(a) / area(b))) > math.log(_GROWTH):
        return math.inf
    sizes = a[2:] - a[:2] + b[2:] - b[:2]
    return math.hypot(*((a[:2] + a[2:] - b[:2] - b[2:]) / sizes))
