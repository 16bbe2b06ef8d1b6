"""The loss of the network: which cells are to find which vehicle, and how well they do.

The cost of a cell for a vehicle is low where the cell's box and score already fit and its middle
is close. Each vehicle gets its cheapest cells: as many as the sum of its best overlaps.
Source: Lyu et al., "RTMDet", 2022, after Ge et al., "YOLOX", 2021 (SimOTA).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from vdet.learn.net.architecture import Network, cell_centers, decode, flatten
from vdet.learn.net.sources import UNKNOWN, NetSource

CANDIDATES = 13
"""The best overlaps of a vehicle that decide how many cells it gets."""

_BOX_WEIGHT, _CLASS_WEIGHT = 2.0, 0.4  # of the loss of a score: 1
_IOU_WEIGHT = 3.0
_FAR = 3.0  # strides from the middle where the cost of the distance is 1
_MIN_REACH = 0.6  # strides around the middle of a small vehicle whose cells may find it
_NEVER = 1e8
_BALANCE = 0.5
"""Exponent of the frequency of a class, relative to the most frequent one, in its weight."""
_MAX_WEIGHT = 6.0
"""Largest weight of a class."""


@dataclass(frozen=True, slots=True, eq=False)
class Vehicles:
    """The labelled vehicles of a batch, one row each.

    Attributes
    ----------
    picture
        int64 `(n,)`: the number of its picture in the batch.
    boxes
        float32 `(n, 4)`: x1, y1, x2, y2, pixels of the input.
    classes
        int64 `(n,)`: its class, -1 where it is not known.
    """

    picture: Tensor
    boxes: Tensor
    classes: Tensor

    def __len__(self) -> int:
        return len(self.boxes)


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Training pictures of one step.

    `pictures` are the inputs of the network; `ignored` are the ignore regions, as `Vehicles`.
    """

    pictures: Tensor
    vehicles: Vehicles
    ignored: Vehicles


def class_weights(sources: Sequence[NetSource], count: int) -> Tensor:
    """Return the weight of each class in the loss, float32 `(count + 1,)`; rare ones have more.

    The last one is that of vehicles of unknown kind, 1. The most frequent class has 1 too.
    """
    found = np.zeros(count + 1)
    for sample in (sample for source in sources for sample in source.samples):
        found += np.bincount(sample.classes[~sample.ignored] % (count + 1), minlength=count + 1)
    weights = (found[:count].max() / np.maximum(found, 1)) ** _BALANCE
    return torch.tensor([*np.minimum(weights[:count], _MAX_WEIGHT), 1.0], dtype=torch.float32)


def loss_of(network: Network, batch: Batch, weights: Tensor) -> Tensor:
    """Return the loss of a batch, a number; `weights` are those of `class_weights`.

    The target of a cell's score is the overlap of its box with the vehicle that it is to find, and
    0 for others (Li et al., "Generalized Focal Loss", 2020). Boxes are compared by generalised
    overlap, classes by cross entropy.
    """
    centers, strides = cell_centers(*batch.pictures.shape[2:])
    raw = flatten(network(batch.pictures))
    scores, boxes = raw[..., 0], decode(raw[..., 1:5], centers, strides)
    row, cell, iou = assign(scores, boxes, batch.vehicles, centers, strides)
    cells = batch.vehicles.picture[row], cell
    targets = torch.zeros_like(scores)
    targets[cells] = iou
    classes = batch.vehicles.classes[row]
    counted = torch.ones_like(scores)
    counted[uncounted(batch.ignored, centers, raw[..., 5:].detach().argmax(-1))] = 0
    counted[cells] = weights[classes].sqrt()
    distance = (targets - scores.sigmoid()).abs()
    focal = functional.binary_cross_entropy_with_logits(scores, targets, reduction="none")
    score_loss = (focal * distance.square() * counted).sum()
    box_loss = ((1 - giou(boxes[cells], batch.vehicles.boxes[row])) * iou).sum()
    class_loss = functional.cross_entropy(
        raw[..., 5:][cells], classes, weights[:-1], ignore_index=UNKNOWN, reduction="sum"
    )
    of_places = (score_loss + _BOX_WEIGHT * box_loss) / iou.sum().clamp(min=1)
    return of_places + _CLASS_WEIGHT * class_loss / max(len(iou), 1)


@torch.no_grad()
def assign(
    scores: Tensor, boxes: Tensor, vehicles: Vehicles, centers: Tensor, strides: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Return which cells are to find which vehicle; a cell has at most one.

    Parameters
    ----------
    scores
        Before the sigmoid, `(B, cells)`.
    boxes
        `(B, cells, 4)`: x1, y1, x2, y2, pixels.
    centers, strides
        Of the cells, see `cell_centers`.

    Returns
    -------
    row, cell, iou
        The row of each vehicle, the cell in its picture, and the overlap of their boxes; all
        `(m,)`.
    """
    middle = (vehicles.boxes[:, :2] + vehicles.boxes[:, 2:]) / 2
    half = (vehicles.boxes[:, 2:] - vehicles.boxes[:, :2]) / 2
    offset = (centers[None] - middle[:, None]).abs()
    reach = torch.maximum(half[:, None], _MIN_REACH * strides[None, :, None])
    row, cell = torch.nonzero((offset < reach).all(-1), as_tuple=True)
    picture = vehicles.picture[row]
    iou = paired_iou(boxes[picture, cell], vehicles.boxes[row])
    logits = scores[picture, cell]
    score_cost = functional.binary_cross_entropy_with_logits(logits, iou, reduction="none")
    distance = offset[row, cell].norm(dim=-1) / strides[cell]
    costs = torch.full((len(vehicles), len(centers)), _NEVER)
    overlaps = torch.zeros_like(costs)
    overlaps[row, cell] = iou
    costs[row, cell] = (
        score_cost * (iou - logits.sigmoid()).square()
        - _IOU_WEIGHT * torch.log(iou + 1e-7)
        + 10 ** (distance - _FAR)
    )
    count = overlaps.topk(CANDIDATES, dim=1).values.sum(1).int().clamp(min=1)
    cheapest = costs.topk(CANDIDATES, dim=1, largest=False)
    wanted = torch.arange(CANDIDATES)[None] < count[:, None]
    chosen = torch.full_like(costs, _NEVER)
    chosen.scatter_(1, cheapest.indices, cheapest.values.where(wanted, _NEVER))
    of_cells = vehicles.picture[:, None].expand_as(chosen)
    lowest = torch.full_like(scores, _NEVER).scatter_reduce(0, of_cells, chosen, "amin")
    is_taken = (chosen < _NEVER) & (chosen == lowest[vehicles.picture])
    row, cell = torch.nonzero(is_taken, as_tuple=True)
    return row, cell, overlaps[row, cell]


def uncounted(ignored: Vehicles, centers: Tensor, seen: Tensor) -> tuple[Tensor, Tensor]:
    """Return the picture and the cell of all cells whose middle lies in an ignore region.

    Of a region with a class, only the cells that see it: `seen` is the best class `(B, cells)`.
    """
    boxes = ignored.boxes[:, None]
    inside = ((centers > boxes[..., :2]) & (centers < boxes[..., 2:])).all(-1)
    classes = ignored.classes[:, None]
    inside &= (classes == UNKNOWN) | (classes == seen[ignored.picture])
    row, cell = torch.nonzero(inside, as_tuple=True)
    return ignored.picture[row], cell


def paired_iou(a: Tensor, b: Tensor) -> Tensor:
    """Return the overlap of each box of `a` with the same row of `b`: `(n, 4)` to `(n,)`."""
    common, union, _ = _areas(a, b)
    return common / union


def giou(a: Tensor, b: Tensor) -> Tensor:
    """Return the generalised overlap, -1 to 1, of each box with the same row of the other.

    Source: Rezatofighi et al., "Generalized Intersection over Union", 2019.
    """
    common, union, around = _areas(a, b)
    return common / union - (around - union) / around


def _areas(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return the areas in common, of the union, and of the smallest box around both."""
    near, far = torch.maximum(a[:, :2], b[:, :2]), torch.minimum(a[:, 2:], b[:, 2:])
    common = (far - near).clamp(min=0).prod(1)
    union = (a[:, 2:] - a[:, :2]).prod(1) + (b[:, 2:] - b[:, :2]).prod(1) - common
    first, last = torch.minimum(a[:, :2], b[:, :2]), torch.maximum(a[:, 2:], b[:, 2:])
    return common, union.clamp(min=1e-6), (last - first).prod(1).clamp(min=1e-6)
