"""From hits to vehicles: the heatmap, the regions where it is hot, and the votes in them.

The heatmap is the sum of the hits of the last frames. A hit adds to the pixels of its vehicle
(`Windows.vehicles`), which with box regression is smaller than the window. The original system
summed heat in the same way.

Each hit votes for the box of the vehicle in its window. A vote has two weights. `presence`, for the
existence of a vehicle, is the probability of the hit, which soon approaches 1. `position`, for the
position of the box, is unbounded, and is highest for the window that fits the vehicle best.

The box with the most agreement is a vehicle. Its votes are averaged and removed, and the others
vote again. This is greedy non-maximum suppression that averages boxes instead of picking one, as
Viola & Jones merge detections ("Robust Real-Time Face Detection", 2004, section 5.6).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import (
    BoolArray,
    Box,
    Float32Array,
    Float64Array,
    area,
    clipped,
    coverage,
    from_xywh,
    iou_matrix,
)
from vdet.config.kinds import HeatSettings
from vdet.config.section import REFERENCE_HEIGHT
from vdet.detect.svm.windows import Windows


@dataclass(frozen=True, slots=True)
class Heat:
    """A heatmap: float32 `values`, each for `shrink` × `shrink` pixels of the frame."""

    values: Float32Array
    shrink: int = 1

    @property
    def peak(self) -> float:
        """The highest value."""
        return float(self.values.max(initial=0))


@dataclass(frozen=True, slots=True)
class HotRegion:
    """A part of a frame with evidence for a vehicle.

    Attributes
    ----------
    box
        Its bounding rectangle, pixels of the frame.
    centroid
        Its centre of mass `(x, y)`, pixels of the frame.
    strength
        The highest heat in it; for a region found by votes, their weight.
    """

    box: Box
    centroid: tuple[float, float]
    strength: float


_BLUR = 15
"""Side of the Gaussian kernel that blurs the heat, in pixels of `REFERENCE_HEIGHT` rows."""
_SHRINK = 4
"""Width and height in pixels of a heat value, with votes; 1 with outlines."""


def sum_heat(recent: Sequence[Windows], size: tuple[int, int], settings: HeatSettings) -> Heat:
    """Return the blurred sum of the hits of the last frames.

    Each hit adds to the values that its vehicle covers: its probability or, with `votes`,
    its probability times its weight.

    Parameters
    ----------
    recent
        The hits of each frame.
    size
        Width and height of the frames, pixels.
    """
    by_votes = settings.votes is not None
    shrink = _SHRINK if by_votes else 1
    total = np.zeros([-(-side // shrink) for side in reversed(size)], np.float32)
    for hits in recent:
        values = np.zeros_like(total)
        heats = hits.probabilities * hits.weights if by_votes else hits.probabilities
        sides = np.maximum(0, np.floor(from_xywh(hits.vehicles) / shrink + 0.5)).astype(np.int64)
        for (left, top, right, bottom), heat in zip(sides.tolist(), heats.tolist(), strict=True):
            values[top:bottom, left:right] += heat
        total += values
    side = int(_BLUR * size[1] / REFERENCE_HEIGHT + 0.5) // shrink | 1  # a kernel has a middle
    if side > 1:
        cv2.GaussianBlur(total, (side, side), 0, dst=total)
    return Heat(total, shrink)


def find_regions(heat: Heat, threshold: float) -> list[HotRegion]:
    """Return the connected regions where `heat` is above `threshold`, from top to bottom.

    A region with a hole is one region: only outer contours count. The centroid is that of the
    filled contour (`cv2.moments`), or the centre of the box if the contour is a line or a point.
    """
    hot = (heat.values > threshold).astype(np.uint8)
    contours, _ = cv2.findContours(hot, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    regions = [_region(heat, hot, contour) for contour in contours]
    return sorted(regions, key=lambda region: (region.box.y1, region.box.x1))


def _region(heat: Heat, hot: npt.NDArray[np.uint8], contour: cv2.typing.MatLike) -> HotRegion:
    x, y, width, height = cv2.boundingRect(contour)
    inside, part = np.zeros((height, width), np.uint8), np.s_[y : y + height, x : x + width]
    cv2.drawContours(inside, [contour], -1, 1, cv2.FILLED, offset=(-x, -y))
    peak = float(heat.values[part][(inside & hot[part]) > 0].max())
    n, moments = heat.shrink, cv2.moments(contour)
    box = Box.sized(n * x, n * y, n * width, n * height)
    if not (area := moments["m00"]):
        return HotRegion(box, box.center, peak)
    offset = (n - 1) / 2  # from the first pixel of a value to their middle
    centroid = (n * moments["m10"] / area + offset, n * moments["m01"] / area + offset)
    return HotRegion(box, centroid, peak)


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
    kept = [vehicles[row] for row in np.flatnonzero(~is_part.any(axis=1))]
    whole = [(Box.of(vehicle.sides.tolist()), vehicle.presence) for vehicle in kept]
    return [HotRegion(box.rounded, box.center, presence) for box, presence in whole]


@dataclass(frozen=True, slots=True, eq=False)
class _AgreedBox:
    """A box `(4,)` that votes agree on, and their weights of position and presence."""

    sides: Float64Array
    position: float
    presence: float


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


def _vehicles(votes: Votes, minimum: float) -> Iterator[_AgreedBox]:
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
            yield _AgreedBox(box, float(agreed[mode]), weight)
            used |= coverage(votes.boxes, box[np.newaxis])[:, 0] > _INSIDE
        presence[used] = position[used] = 0


def _average(boxes: Float64Array, weights: Float64Array, overlaps: Float64Array) -> Float64Array:
    """Average the boxes that agree; a better overlap counts more."""
    agreeing = np.where(overlaps > _AGREEMENT, weights * overlaps**2, 0)
    if not (total := agreeing.sum()):
        return np.asarray(boxes[int(overlaps.argmax())])
    return np.asarray(agreeing @ boxes / total)
