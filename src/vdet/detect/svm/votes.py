"""Split hot regions into vehicles by the votes of the hits in them.

Each hit votes for the box of the vehicle in its window. A vote has two weights. `presence`, for the
existence of a vehicle, is the probability of the hit, which soon approaches 1. `position`, for the
position of the box, is unbounded, and is highest for the window that fits the vehicle best.

The box with the most agreement is a vehicle. Its votes are averaged and removed, and the others
vote again. This is greedy non-maximum suppression that averages boxes instead of picking one, as
Viola & Jones merge detections ("Robust Real-Time Face Detection", 2004, section 5.6).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import BoolArray, Box, Float64Array, area, clipped, coverage, from_xywh, iou_matrix
from vdet.detect.svm.heat import HotRegion
from vdet.detect.svm.windows import Windows

MAX_VOTES = 400
"""Maximum number of votes in a group of regions, because time grows with its square."""

_MAX_PROBABILITY = 1 - 2**-24
"""Limit of probabilities, because the position weight of 1 is infinite."""

_AGREEMENT = 0.35
"""Minimum intersection over union of two boxes that agree."""

_INSIDE = 0.7
"""A box with more than this fraction inside a larger vehicle is a part of it."""

_SHARPNESS = 4.0
"""Exponent of -log(1 - probability) in the `position` weight, so that the best fit counts most."""

_FAR_STRONGER = 4
"""Minimum ratio of weights for a box inside another one to be kept."""


@dataclass(frozen=True, slots=True)
class Votes:
    """The votes of some hits.

    Attributes
    ----------
    boxes
        float64 `(n, 4)`: x1, y1, x2, y2, pixels of the frame.
    presence
        float64 `(n,)`: weight for the existence of a vehicle.
    position
        float64 `(n,)`, above 0: weight for the sides of the box.
    """

    boxes: Float64Array
    presence: Float64Array
    position: Float64Array

    @staticmethod
    def of(hits: Sequence[Windows], size: tuple[int, int]) -> "Votes":
        """Collect the votes of the hits of some frames.

        Boxes are clipped to the frame of `size` (width and height, pixels), because windows can
        only guess how far a vehicle extends beyond it.
        """
        boxes = from_xywh(np.concatenate([hit.vehicles for hit in hits]))
        weights = np.concatenate([hit.weights for hit in hits], dtype=np.float64)
        probabilities = np.concatenate([hit.probabilities for hit in hits], dtype=np.float64)
        bounded = np.clip(probabilities, 1 - _MAX_PROBABILITY, _MAX_PROBABILITY)
        position, inside = (-np.log1p(-bounded)) ** _SHARPNESS, clipped(boxes, size)
        seen = (inside[:, 2:] - inside[:, :2] >= 1).all(axis=1)
        return Votes(inside[seen], (probabilities * weights)[seen], position[seen])

    def within(self, boxes: Iterable[Box]) -> "Votes":
        """Return the votes whose centre lies in one of `boxes`, each once.

        At most `MAX_VOTES` are returned, those with the highest `position`.
        """
        x, y = ((self.boxes[:, :2] + self.boxes[:, 2:]) / 2).T
        inside = np.zeros(len(x), np.bool_)
        for box in boxes:
            inside |= (box.x1 <= x) & (x < box.x2) & (box.y1 <= y) & (y < box.y2)
        (indices,) = np.nonzero(inside)
        best = np.argsort(-self.position[indices], kind="stable")[:MAX_VOTES]
        indices = np.sort(indices[best])
        return Votes(self.boxes[indices], self.presence[indices], self.position[indices])


def split_regions(regions: Sequence[HotRegion], votes: Votes, minimum: float) -> list[HotRegion]:
    """Return the vehicles that the votes in the regions agree on, strongest first in each region.

    Regions whose boxes overlap are split together, so that no vote counts twice. A box inside a
    larger one is kept only if it is far stronger; the tracker, or `SvmDetector` for a single image,
    shows one of the two. `minimum` is the minimum weight of agreeing votes.
    """
    groups = _overlapping([region.box for region in regions])
    vehicles = [vehicle for group in groups for vehicle in _vehicles(votes.within(group), minimum)]
    sides = np.reshape([vehicle.sides for vehicle in vehicles], (-1, 4))
    position = np.array([vehicle.position for vehicle in vehicles])
    is_part: BoolArray = coverage(sides, sides) > _INSIDE
    is_part &= area(sides) > area(sides)[:, np.newaxis]
    is_part &= _FAR_STRONGER * position > position[:, np.newaxis]
    return [vehicles[row].region for row in np.flatnonzero(~is_part.any(axis=1))]


@dataclass(frozen=True, slots=True, eq=False)
class _Vehicle:
    """A box `(4,)` that votes agree on, and their weights of position and presence."""

    sides: Float64Array
    position: float
    presence: float

    @property
    def region(self) -> HotRegion:
        box = Box.of(self.sides.tolist())
        return HotRegion(box.rounded, box.center, self.presence)


def _overlapping(boxes: Iterable[Box]) -> list[list[Box]]:
    """Group boxes that overlap, directly or through others."""
    groups: list[list[Box]] = []
    for box in boxes:
        joined, apart = [box], []
        for group in groups:
            if any(box.intersection(member).area for member in group):
                joined = group + joined
            else:
                apart.append(group)
        groups = [*apart, joined]
    return groups


def _vehicles(votes: Votes, minimum: float) -> Iterator[_Vehicle]:
    """Yield the vehicles that votes agree on, the one with most agreement first."""
    overlaps = iou_matrix(votes.boxes, votes.boxes)
    presence, position = votes.presence.copy(), votes.position.copy()
    # Presence only falls: when no box has enough, no more will be found.
    while position.any() and (overlaps @ presence).max() >= minimum:
        agreed = np.where(position > 0, overlaps @ position, 0)
        mode = int(agreed.argmax())
        box = _average(votes.boxes, position, overlaps[mode])
        around = iou_matrix(box[np.newaxis], votes.boxes)[0]
        box = _average(votes.boxes, position, around)
        weight = float(overlaps[mode] @ presence)
        used = np.maximum(around, overlaps[mode]) > _AGREEMENT
        used[mode] = True
        if weight >= minimum:
            yield _Vehicle(box, float(agreed[mode]), weight)
            used |= coverage(votes.boxes, box[np.newaxis])[:, 0] > _INSIDE
        presence[used] = position[used] = 0


def _average(boxes: Float64Array, weights: Float64Array, overlaps: Float64Array) -> Float64Array:
    """Average the boxes that agree; a better overlap counts more."""
    agreeing = np.where(overlaps > _AGREEMENT, weights * overlaps**2, 0)
    if not (total := agreeing.sum()):
        return np.asarray(boxes[int(overlaps.argmax())])
    return np.asarray(agreeing @ boxes / total)
