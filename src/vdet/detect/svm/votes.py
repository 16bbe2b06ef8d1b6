"""Hot regions split into vehicles by the votes of the windows in them.

A detection votes for the box of the vehicle that it shows, and its vote weighs twice. Whether there
is a vehicle: by its probability, which soon comes near to 1. Where it is: by how far the window is
from being none, which is most where it fits the vehicle best. The box that most votes agree with
is a vehicle; these are averaged and used up, and the rest vote again: greedy non-maximum
suppression that averages instead of picking one, as Viola & Jones, "Robust Real-Time Face
Detection", 2004, section 5.6, merge detections.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vdet.config.schema import VoteSettings
from vdet.detect.svm.heat import Region
from vdet.detect.svm.windows import Windows
from vdet.geometry import Box, Float64Array, coverage, iou_matrix, visible

MOST_VOTES = 400
"""In a region; of more, the surest are heard. Keeps the square of their number small."""


_SUREST = 1 - 2**-24
"""Probabilities above it are taken for it; in float32 they may be 1."""


@dataclass(frozen=True, slots=True)
class Votes:
    """Boxes voted for, float64 `(n, 4)` of x, y, width, height, and the weights of the votes.

    `whether`, float64 `(n,)`, is the weight for there being a vehicle; `where`, `(n,)`, above 0,
    for the place of its box.
    """

    boxes: Float64Array
    whether: Float64Array
    where: Float64Array

    @staticmethod
    def of(detections: Sequence[Windows], size: tuple[int, int], settings: VoteSettings) -> "Votes":
        """Collect the votes of some frames' detections.

        What lies outside the frame of `size`, width and height in pixels, is cut off: how far a
        vehicle reaches there, windows can only guess, and need not agree on.
        """
        boxes = np.concatenate([each.vehicles for each in detections], dtype=np.float64)
        shares = np.concatenate([each.shares for each in detections], dtype=np.float64)
        sure = np.concatenate([each.probabilities for each in detections], dtype=np.float64)
        where = (-np.log1p(-np.clip(sure, 1 - _SUREST, _SUREST))) ** settings.sharpness
        inside = visible(boxes, size)
        seen = (inside[:, 2:] >= 1).all(axis=1)
        return Votes(inside[seen], (sure * shares)[seen], where[seen])

    def within(self, box: Box) -> "Votes":
        """Return those whose centre lies in `box`; the surest where they are too many."""
        x, y = (self.boxes[:, :2] + self.boxes[:, 2:] / 2).T
        inside = (box.x <= x) & (x < box.right) & (box.y <= y) & (y < box.bottom)
        (numbers,) = np.nonzero(inside)
        surest = np.argsort(-self.where[numbers], kind="stable")[:MOST_VOTES]
        numbers = np.sort(numbers[surest])
        return Votes(self.boxes[numbers], self.whether[numbers], self.where[numbers])


@dataclass(frozen=True, slots=True, eq=False)
class _Vehicle:
    """A box, `(4,)`, the agreement on it, and the evidence for it."""

    box: Float64Array
    agreed: float
    evidence: float


def split_regions(regions: Sequence[Region], votes: Votes, settings: VoteSettings) -> list[Region]:
    """Replace each region by the vehicles that the votes in it agree on, strongest first."""
    return [
        vehicle for region in regions for vehicle in _vehicles(votes.within(region.box), settings)
    ]


def _vehicles(votes: Votes, settings: VoteSettings) -> list[Region]:
    overlaps = iou_matrix(votes.boxes, votes.boxes)
    whether, where = votes.whether.copy(), votes.where.copy()
    found: list[_Vehicle] = []
    while where.any():
        agreed = np.where(where > 0, overlaps @ where, 0)
        mode = int(agreed.argmax())
        box = _average(votes.boxes, where, overlaps[mode], settings.agreement)
        around = iou_matrix(box[np.newaxis], votes.boxes)[0]
        box = _average(votes.boxes, where, around, settings.agreement)
        vehicle = _Vehicle(box, float(agreed[mode]), float(overlaps[mode] @ whether))
        used = np.maximum(around, overlaps[mode]) > settings.agreement
        used[mode] = True  # no vote is heard twice, even where agreement is 1
        if vehicle.evidence >= settings.least:
            found.append(vehicle)
            used |= coverage(votes.boxes, box[np.newaxis])[:, 0] > settings.inside
        whether[used] = where[used] = 0
    return [_region(each) for each in found if not _is_part(each, found, settings.inside)]


def _average(
    boxes: Float64Array, weights: Float64Array, overlaps: Float64Array, agreement: float
) -> Float64Array:
    """Average the boxes that agree; better overlap counts more."""
    shares = np.where(overlaps > agreement, weights * overlaps**2, 0)
    total = shares.sum()
    if not total:
        return np.asarray(boxes[int(overlaps.argmax())])
    return np.asarray(shares @ boxes / total)


def _is_part(vehicle: _Vehicle, others: Sequence[_Vehicle], inside: float) -> bool:
    """Tell whether a larger vehicle, agreed on about as well, holds this one."""
    box = vehicle.box
    return any(
        other.box[2] * other.box[3] > box[2] * box[3]
        and coverage(box[np.newaxis], other.box[np.newaxis])[0, 0] > inside
        and other.agreed > vehicle.agreed / 2
        for other in others
    )


def _region(vehicle: _Vehicle) -> Region:
    box = vehicle.box
    x1, y1 = np.floor(box[:2] + 0.5).astype(int).tolist()
    x2, y2 = np.floor(box[:2] + box[2:] + 0.5).astype(int).tolist()
    x, y = (box[:2] + box[2:] / 2).tolist()
    return Region(Box(x1, y1, x2 - x1, y2 - y1), (x, y), vehicle.evidence)
