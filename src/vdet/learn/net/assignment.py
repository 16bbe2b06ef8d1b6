"""Assignment of vehicles to the cells of the network that are to find them.

The cost of a cell for a vehicle is low where the cell's box and score already fit and its middle
is close. Each vehicle gets its cheapest cells: as many as the sum of its best overlaps.
Source: Lyu et al., "RTMDet", 2022, after Ge et al., "YOLOX", 2021 (SimOTA).
"""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from vdet.learn.net.losses import paired_iou

CANDIDATES = 13
"""The best overlaps of a vehicle that decide how many cells it gets."""

_IOU_WEIGHT = 3.0
_FAR = 3.0  # strides from the middle where the cost of the distance is 1
_LEAST_REACH = 0.6  # strides around the middle of a small vehicle whose cells may find it
_NEVER = 1e8


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
    reach = torch.maximum(half[:, None], _LEAST_REACH * strides[None, :, None])
    row, cell = torch.nonzero((offset < reach).all(-1), as_tuple=True)
    picture = vehicles.picture[row]
    iou = paired_iou(boxes[picture, cell], vehicles.boxes[row])
    logits = scores[picture, cell]
    score_cost = functional.binary_cross_entropy_with_logits(logits, iou, reduction="none")
    distance = offset[row, cell].norm(dim=-1) / strides[cell]
    cost = (
        score_cost * (iou - logits.sigmoid()).square()
        - _IOU_WEIGHT * torch.log(iou + 1e-7)
        + 10 ** (distance - _FAR)
    )
    costs = torch.full((len(vehicles), len(centers)), _NEVER)
    overlaps = torch.zeros_like(costs)
    costs[row, cell] = cost
    overlaps[row, cell] = iou
    chosen = _cheapest(costs, overlaps)
    row, cell = torch.nonzero(chosen, as_tuple=True)
    keep = _one_for_each_cell(vehicles.picture[row] * len(centers) + cell, costs[row, cell])
    row, cell = row[keep], cell[keep]
    return row, cell, overlaps[row, cell]


def _cheapest(costs: Tensor, overlaps: Tensor) -> Tensor:
    """Return which cells each vehicle gets, bool `(n, cells)`."""
    count = overlaps.topk(CANDIDATES, dim=1).values.sum(1).int().clamp(min=1)
    cheapest = costs.topk(CANDIDATES, dim=1, largest=False)
    wanted = torch.arange(CANDIDATES)[None] < count[:, None]
    chosen = torch.zeros_like(costs, dtype=torch.bool)
    chosen.scatter_(1, cheapest.indices, wanted & (cheapest.values < _NEVER))
    return chosen


def _one_for_each_cell(cells: Tensor, costs: Tensor) -> Tensor:
    """Return the rows to keep: of those with the same cell, the one of the lowest cost."""
    order = torch.argsort(costs, stable=True)
    order = order[torch.argsort(cells[order], stable=True)]
    first = torch.ones(len(order), dtype=torch.bool)
    first[1:] = cells[order][1:] != cells[order][:-1]
    return order[first]
