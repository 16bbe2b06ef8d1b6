"""Boxes that overlap: a vehicle before another one, two parts of one, or two seen as one.

On a flat road what is nearer stands lower in the picture. So of two vehicles that overlap the one
with the lower bottom hides the other, and two boxes that overlap and stand level are of one
vehicle: two would be in the same place.
"""

import numpy as np
import numpy.typing as npt

from vdet.boxes import Float64Array, coverage, iou_matrix

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

CLEAR = 0.8
"""A detection on a nearer vehicle that scores less than this share of its score is a part of it."""


def are_hidden(boxes: Float64Array, present: npt.NDArray[np.bool_], share: float) -> list[bool]:
    """Tell of each box whether another one covers more than `share` of it and is not farther.

    Parameters
    ----------
    boxes
        Shape `(n, 4)`: x1, y1, x2, y2 in pixels, each with an area.
    present
        Shape `(n,)`: those that can hide others.
    """
    bottoms = boxes[:, 3]
    farther = bottoms < (bottoms - _LEVEL * (bottoms - boxes[:, 1]))[:, np.newaxis]
    hiding = (coverage(boxes, boxes) > share) & present & ~farther
    np.fill_diagonal(hiding, val=False)
    return [bool(row.any()) for row in hiding]


def is_same(box: Float64Array, others: Float64Array) -> bool:
    """Tell whether `box`, `(4,)`, shows the same vehicle as one of `others`, `(n, 4)`."""
    one = box[np.newaxis]
    height = np.minimum(box[3] - box[1], others[:, 3] - others[:, 1])
    level = np.abs(others[:, 3] - box[3]) < _LEVEL * height
    overlap = np.maximum(coverage(one, others)[0], coverage(others, one)[:, 0])
    alike = iou_matrix(one, others)[0] > _ALIKE
    return bool((alike | (level & (overlap > _LEVEL_OVERLAP))).any())


def are_parts(boxes: Float64Array, scores: Float64Array, share: float) -> npt.NDArray[np.bool_]:
    """Tell of each box, `(n, 4)`, whether more than `share` of it lies in one that scores higher.

    A vehicle that comes out from behind another one has nearly the same score, and is no part.

    Returns
    -------
    bool `(n,)`.
    """
    weaker = scores[:, np.newaxis] < CLEAR * scores
    return np.asarray(((coverage(boxes, boxes) > share) & weaker).any(axis=1))


def is_part(box: Float64Array, others: Float64Array, share: float) -> bool:
    """Tell whether more than `share` of `box`, `(4,)`, lies in one of `others`, `(n, 4)`."""
    return bool((coverage(box[np.newaxis], others) > share).any())


def around(boxes: Float64Array) -> Float64Array:
    """Return the smallest box, `(4,)`, that covers all of `boxes`, `(n, 4)`."""
    return np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])


def shows_both(found: Float64Array, expected: Float64Array, share: float) -> bool:
    """Tell whether the region `found`, `(4,)`, shows both vehicles `expected`, `(2, 4)`, as one.

    So it is where more than `share` of the second lies in it and it fits the box around both
    better than the first one alone.
    """
    region = found[np.newaxis]
    alone, together = iou_matrix(region, np.stack([expected[0], around(expected)]))[0]
    return is_part(expected[1], region, share) and bool(together > alone)


def stretched(box: Float64Array, before: Float64Array, after: Float64Array) -> Float64Array:
    """Return `box` moved and scaled as `before` was to become `after`; all of shape `(4,)`."""
    scale = (after[2:] - after[:2]) / (before[2:] - before[:2])
    return after[[0, 1, 0, 1]] + (box - before[[0, 1, 0, 1]]) * scale[[0, 1, 0, 1]]
