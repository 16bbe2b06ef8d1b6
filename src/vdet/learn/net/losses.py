"""The loss of the network on a batch."""

import torch
from torch import Tensor
from torch.nn import functional

BOX_WEIGHT = 2.0
CLASS_WEIGHT = 0.4


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


def quality_focal_loss(logits: Tensor, targets: Tensor) -> Tensor:
    """Return the loss of each score against its target, 0 to 1; both of the same shape.

    The target of a cell that is to find a vehicle is the overlap of their boxes; others have 0.
    Source: Li et al., "Generalized Focal Loss", 2020.
    """
    distance = (targets - logits.sigmoid()).abs()
    loss = functional.binary_cross_entropy_with_logits(logits, targets, reduction="none")
    return loss * distance.square()


def _areas(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return the areas in common, of the union, and of the smallest box around both."""
    near, far = torch.maximum(a[:, :2], b[:, :2]), torch.minimum(a[:, 2:], b[:, 2:])
    common = (far - near).clamp(min=0).prod(1)
    union = (a[:, 2:] - a[:, :2]).prod(1) + (b[:, 2:] - b[:, :2]).prod(1) - common
    first, last = torch.minimum(a[:, :2], b[:, :2]), torch.maximum(a[:, 2:], b[:, 2:])
    return common, union.clamp(min=1e-6), (last - first).prod(1).clamp(min=1e-6)
