"""Hot regions split into vehicles by the votes of the windows in them.

A detection votes with its probability for the box of the vehicle that it shows. The box that most
votes agree with is a vehicle; these are averaged and used up, and the rest vote again: greedy
non-maximum suppression that averages instead of picking one, as Viola & Jones, "Robust Real-Time
Face Detection", 2004, section 5.6, merge detections.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vdet.config.schema import VoteSettings
from vdet.geometry import Box
from vdet.heatmap import Region
from vdet.overlaps import Floats, coverage, iou_matrix, visible
from vdet.windows import Windows

MOST_VOTES = 400
"""In a region; of more, the likeliest are heard. Keeps the square of their number small."""


@dataclass(frozen=True, slots=True)
class Votes:
    """Boxes voted for, float64 `(n, 4)` of x, y, width, height, and weights, float64 `(n,)`."""

    boxes: Floats
    weights: Floats

    @staticmethod
    def of(detections: Sequence[Windows], size: tuple[int, int]) -> "Votes":
        """Collect the votes of some frames' detections, each its probability times its share.

        What lies outside the frame of `size`, width and height in pixels, is cut off: how far a
        vehicle reaches there, windows can only guess, and need not agree on.
        """
        boxes = np.concatenate([each.vehicles for each in detections], dtype=np.float64)
        weights = [each.probabilities * each.shares for each in detections]
        inside = visible(boxes, size)
        seen = (inside[:, 2:] >= 1).all(axis=1)
        return Votes(inside[seen], np.concatenate(weights, dtype=np.float64)[seen])

    def within(self, box: Box) -> "Votes":
        """Return those whose centre lies in `box`; the weightiest where they are too many."""
        x, y = (self.boxes[:, :2] + self.boxes[:, 2:] / 2).T
        inside = (box.x <= x) & (x < box.right) & (box.y <= y) & (y < box.bottom)
        (numbers,) = np.nonzero(inside)
        heaviest = np.argsort(-self.weights[numbers], kind="stable")[:MOST_VOTES]
        numbers = np.sort(numbers[heaviest])
        return Votes(self.boxes[numbers], self.weights[numbers])


def split_regions(regions: Sequence[Region], votes: Votes, settings: VoteSettings) -> list[Region]:
    """Replace each region by the vehicles that the votes in it agree on, strongest first."""
    return [
        vehicle for region in regions for vehicle in _vehicles(votes.within(region.box), settings)
    ]


def _vehicles(votes: Votes, settings: VoteSettings) -> list[Region]:
    overlaps = iou_matrix(votes.boxes, votes.boxes)
    left = votes.weights.copy()
    found: list[tuple[Floats, float]] = []
    while len(left):
        agreed = np.where(left > 0, overlaps @ left, 0)
        mode = int(agreed.argmax())
        if agreed[mode] < settings.least or agreed[mode] <= 0:
            break
        box = _average(votes.boxes, left, overlaps[mode], settings.agreement)
        around = iou_matrix(box[np.newaxis], votes.boxes)[0]
        box = _average(votes.boxes, left, around, settings.agreement)
        found.append((box, float(agreed[mode])))
        used = np.maximum(around, overlaps[mode]) > settings.agreement
        inside = coverage(votes.boxes, box[np.newaxis])[:, 0] > settings.inside
        left[used | inside] = 0
        left[mode] = 0  # no vote is heard twice, even where agreement is 1
    return [_region(*each) for each in found if not _is_part(each, found, settings.inside)]


def _average(boxes: Floats, weights: Floats, overlaps: Floats, agreement: float) -> Floats:
    """Average the boxes that agree; better overlap counts more."""
    shares = np.where(overlaps > agreement, weights * overlaps**2, 0)
    total = shares.sum()
    if not total:
        return np.asarray(boxes[int(overlaps.argmax())])
    return np.asarray(shares @ boxes / total)


def _is_part(
    vehicle: tuple[Floats, float], others: Sequence[tuple[Floats, float]], inside: float
) -> bool:
    """Tell whether a larger vehicle of some weight holds this one."""
    box, weight = vehicle
    return any(
        other[2] * other[3] > box[2] * box[3]
        and coverage(box[np.newaxis], other[np.newaxis])[0, 0] > inside
        and other_weight > weight / 2
        for other, other_weight in others
    )


def _region(box: Floats, weight: float) -> Region:
    x1, y1 = np.floor(box[:2] + 0.5).astype(int).tolist()
    x2, y2 = np.floor(box[:2] + box[2:] + 0.5).astype(int).tolist()
    x, y = (box[:2] + box[2:] / 2).tolist()
    return Region(Box(x1, y1, x2 - x1, y2 - y1), (x, y), weight)
