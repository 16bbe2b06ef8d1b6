"""Output layouts: functions that convert the output of a network to boxes."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float32Array, Int32Array
from vdet.detect.onnx.session import Array

STRIDES = (8, 16, 32)
"""Distance between the cells of each level, pixels of the input."""

Cells = tuple[Float32Array, Float32Array]
"""Centres `(cells, 2)`, x and y in pixels of the input, and strides `(cells,)` of all cells."""


@dataclass(frozen=True, slots=True, eq=False)
class RawBoxes:
    """Boxes as the network gives them, before any check; only decoding uses them.

    `sides` float32 `(n, 4)`: x1, y1, x2, y2, pixels of the input or of the frame; `scores` float32
    `(n,)`, 0 to 1; `classes` int32 `(n,)`: indices in the names of the network; `class_scores`
    float32 `(n, len(names))`: probability of each class, None if the network outputs only the best
    class.
    """

    sides: Float32Array
    scores: Float32Array
    classes: Int32Array
    class_scores: Float32Array | None = None


def joined(parts: Sequence[RawBoxes]) -> RawBoxes:
    """Return the boxes of several searches of one picture."""
    if len(parts) == 1:
        return parts[0]
    columns = ([getattr(part, name) for part in parts] for name in RawBoxes.__slots__)
    return RawBoxes(*map(np.concatenate, columns))


OutputLayout = Callable[[Array, float], RawBoxes]
"""Converts an output to boxes in pixels of the input; drops scores below a minimum."""


def our_cells(
    output: Array, minimum: float, *, cells: Cells, calibration: Float32Array
) -> RawBoxes:
    """Read our own networks: `(1, cells, 5 + classes)`; see `vdet.learn.net.network`.

    `cells` are those of the input, from `cell_centers`; `calibration` `(classes, 2)` has slope and
    offset of each class.
    """
    (table,), (centers, strides) = output, cells
    if table.shape != (len(strides), 5 + len(calibration)):
        raise ValueError("not one row per cell, or not one column per class")
    best = table[:, 5:].argmax(axis=1)
    slopes, offsets = calibration[best].T
    logits = slopes * table[:, 0] + offsets
    rows = np.flatnonzero(logits >= math.log(minimum / (1 - minimum)))
    lengths = np.logaddexp(0, table[rows, 1:5] + 1) * strides[rows, np.newaxis]
    middle = centers[rows]
    sides = np.concatenate([middle - lengths[:, :2], middle + lengths[:, 2:]], axis=1)
    class_scores = np.exp(table[rows, 5:] - table[rows, 5:].max(axis=1, keepdims=True))
    return _raw(sides, 1 / (1 + np.exp(-logits[rows])), best[rows], class_scores)


def center_columns(output: Array, minimum: float) -> RawBoxes:
    """Read Ultralytics v8 and later: `(1, 4 + classes, n)`, columns of middle, size and scores."""
    table = output[0].T
    scores = table[:, 4:]
    best, classes = scores.max(axis=1), scores.argmax(axis=1)
    rows = np.flatnonzero(best >= minimum)
    middle, half = table[rows, :2], table[rows, 2:4] / 2
    sides = np.concatenate([middle - half, middle + half], axis=1)
    return _raw(sides, best[rows], classes[rows], scores[rows])


def final_rows(output: Array, minimum: float) -> RawBoxes:
    """Read `(1, n, 6)` after suppression: x1, y1, x2, y2, score, class; empty rows have score 0."""
    table = output[0]
    table = table[table[:, 4] >= minimum]
    return _raw(table[:, :4], table[:, 4], table[:, 5])


def cell_centers(width: int, height: int) -> Cells:
    """Return centre and stride of all cells of an input."""
    centers, strides = [], []
    for stride in STRIDES:
        y, x = np.mgrid[: height // stride, : width // stride]
        centers.append((np.stack([x.ravel(), y.ravel()], axis=1) + 0.5) * stride)
        strides.append(np.full(x.size, stride))
    return np.concatenate(centers).astype(np.float32), np.concatenate(strides).astype(np.float32)


def _raw(
    sides: Array, scores: Array, classes: Array, class_scores: Array | None = None
) -> RawBoxes:
    """Return the boxes; each row of `class_scores`, at least 0, is normalized to a sum of 1."""
    if class_scores is not None:
        class_scores = np.nan_to_num(class_scores.astype(np.float32).clip(1e-9, 1))
        class_scores /= class_scores.sum(axis=1, keepdims=True)
    scores = scores.astype(np.float32).clip(0, 1)
    return RawBoxes(sides.astype(np.float32), scores, classes.astype(np.int32), class_scores)
