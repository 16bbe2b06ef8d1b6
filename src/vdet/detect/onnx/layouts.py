"""Layouts of outputs: functions that turn the outputs of networks into boxes."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float32Array, Int32Array
from vdet.detect.onnx.session import Array

STRIDES = (8, 16, 32)
"""Pixels of the input between the cells of each level, of our networks and of YOLOX."""

Cells = tuple[Float32Array, Float32Array]
"""Middles `(cells, 2)`, x and y in pixels of the input, and strides `(cells,)` of all cells."""


@dataclass(frozen=True, slots=True, eq=False)
class RawBoxes:
    """Boxes before suppression.

    `boxes` float32 `(n, 4)`: x1, y1, x2, y2, pixels of the input or of the frame; `scores` float32
    `(n,)`, 0 to 1; `classes` int32 `(n,)`: indices in the names of the network or of the settings;
    `class_scores` float32 `(n, len(names))`: how likely each is, None where the network only says
    which class is the best.
    """

    boxes: Float32Array
    scores: Float32Array
    classes: Int32Array
    class_scores: Float32Array | None = None


OutputLayout = Callable[[Sequence[Array], float], RawBoxes]
"""Turns outputs into boxes in pixels of the input; leaves out scores below a limit."""


def our_cells(
    outputs: Sequence[Array], minimum: float, *, cells: Cells, calibration: Float32Array
) -> RawBoxes:
    """Read our own networks: `(1, cells, 5 + classes)`; see `vdet.learn.net.network`.

    `cells` are those of the input, from `cell_centers`; `calibration` `(classes, 2)` has slope and
    offset of each class.
    """
    table = outputs[0][0]
    if len(table) != len(cells[1]):
        raise ValueError("not one row per cell")
    best = table[:, 5:].argmax(axis=1)
    slopes, offsets = calibration[best].T
    logits = slopes * table[:, 0] + offsets
    rows = np.flatnonzero(logits >= math.log(minimum / (1 - minimum)))
    centers, strides = cells
    lengths = np.logaddexp(0, table[rows, 1:5] + 1) * strides[rows, np.newaxis]
    middle = centers[rows]
    boxes = np.concatenate([middle - lengths[:, :2], middle + lengths[:, 2:]], axis=1)
    classes = np.exp(table[rows, 5:] - table[rows, 5:].max(axis=1, keepdims=True))
    return _raw(boxes, 1 / (1 + np.exp(-logits[rows])), best[rows], classes)


def center_columns(outputs: Sequence[Array], minimum: float) -> RawBoxes:
    """Read Ultralytics v8 and v11: `(1, 4 + nc, n)`, columns of middle, size and class scores."""
    table = outputs[0][0].T
    return _of_best_classes(table[:, :2], table[:, 2:4], table[:, 4:], minimum)


def center_fractions(
    outputs: Sequence[Array], minimum: float, *, size: tuple[int, int]
) -> RawBoxes:
    """Read RT-DETR of Ultralytics: rows of middle and size, as fractions, and class scores.

    `size` is width and height of the input, pixels.
    """
    table = outputs[0][0]
    return _of_best_classes(table[:, :2] * size, table[:, 2:4] * size, table[:, 4:], minimum)


def center_rows(outputs: Sequence[Array], minimum: float, *, grid: Cells | None = None) -> RawBoxes:
    """Read YOLOX: rows of middle, size, objectness and class scores.

    `grid` are the cells of the input where middles and sizes are relative to those.
    """
    table = outputs[0][0]
    middle, size = table[:, :2], table[:, 2:4]
    if grid is not None:
        centers, strides = grid
        middle = centers + (middle - 0.5) * strides[:, np.newaxis]  # offsets from the cell's corner
        size = np.exp(np.minimum(size, 20)) * strides[:, np.newaxis]
    return _of_best_classes(middle, size, table[:, 4:5] * table[:, 5:], minimum)


def final_rows(outputs: Sequence[Array], minimum: float) -> RawBoxes:
    """Read rows of x1, y1, x2, y2, score, class after suppression; empty rows have score 0."""
    table = outputs[0][0]
    table = table[table[:, 4] >= minimum]
    return _raw(table[:, :4], table[:, 4], table[:, 5])


def named_columns(
    outputs: Sequence[Array], minimum: float, order: tuple[int, int, int]
) -> RawBoxes:
    """Read RT-DETR; `order` has the places of the outputs labels, boxes and scores."""
    labels, boxes, scores = (outputs[place][0] for place in order)
    rows = np.flatnonzero(scores >= minimum)
    return _raw(boxes[rows], scores[rows], labels[rows])


def cell_centers(width: int, height: int) -> Cells:
    """Return the middle and the stride of all cells of an input."""
    centers, strides = [], []
    for stride in STRIDES:
        y, x = np.mgrid[: height // stride, : width // stride]
        centers.append((np.stack([x.ravel(), y.ravel()], axis=1) + 0.5) * stride)
        strides.append(np.full(x.size, stride))
    return np.concatenate(centers).astype(np.float32), np.concatenate(strides).astype(np.float32)


def _of_best_classes(middle: Array, size: Array, scores: Array, minimum: float) -> RawBoxes:
    """Return a box of its best class for each row of `scores`, `(n, classes)`."""
    classes = scores.argmax(axis=1)
    best = scores[np.arange(len(scores)), classes]
    rows = np.flatnonzero(best >= minimum)
    half = size[rows] / 2
    boxes = np.concatenate([middle[rows] - half, middle[rows] + half], axis=1)
    return _raw(boxes, best[rows], classes[rows], scores[rows])


def _raw(
    boxes: Array, scores: Array, classes: Array, class_scores: Array | None = None
) -> RawBoxes:
    """Return the boxes; each row of `class_scores`, at least 0, becomes one whose sum is 1.

    Raises `ValueError` where the shapes do not fit each other.
    """
    count = len(scores)
    clipped = np.clip(scores.astype(np.float32).reshape(count), 0, 1)
    numbers = classes.astype(np.int32).reshape(count)
    if class_scores is not None:
        class_scores = np.nan_to_num(class_scores.astype(np.float32).clip(1e-9, 1))
        class_scores /= class_scores.sum(axis=1, keepdims=True)
    return RawBoxes(boxes.astype(np.float32).reshape(count, 4), clipped, numbers, class_scores)
