"""The forms in which networks give boxes: each turns the outputs into boxes, scores and classes."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vdet.boxes import Float32Array, Int32Array
from vdet.config.train import NetworkScoreSettings
from vdet.detect.onnx.session import Array

STRIDES = (8, 16, 32)
"""Pixels of the input between the cells of each level, of our networks and of YOLOX."""

Cells = tuple[Float32Array, Float32Array]
"""The middle `(cells, 2)`, x and y in pixels of the input, and the stride `(cells,)` of cells."""


@dataclass(frozen=True, slots=True, eq=False)
class RawBoxes:
    """What a network finds in its input, before suppression.

    `boxes` float32 `(n, 4)`: x1, y1, x2, y2, pixels of the input; `scores` float32 `(n,)`, 0 to 1;
    `classes` int32 `(n,)`: numbers as the network counts them.
    """

    boxes: Float32Array
    scores: Float32Array
    classes: Int32Array


class Layout(Protocol):
    """One form of outputs."""

    def decode(self, outputs: list[Array], least: float) -> RawBoxes:
        """Return the boxes with scores of at least `least`."""


@dataclass(frozen=True, slots=True, eq=False)
class OurCells:
    """Our own networks: `(1, cells, 5 + classes)`; see `vdet.learn.net.architecture`.

    `cells` are those of the input, from `cell_centers`.
    """

    cells: Cells
    score: NetworkScoreSettings

    def decode(self, outputs: list[Array], least: float) -> RawBoxes:
        """Return the boxes with scores of at least `least`."""
        table = outputs[0][0]
        logits = self.score.slope * table[:, 0] + self.score.offset
        rows = np.flatnonzero(logits >= math.log(least / (1 - least)))
        centers, strides = self.cells
        lengths = np.logaddexp(0, table[rows, 1:5] + 1) * strides[rows, np.newaxis]
        middle = centers[rows]
        boxes = np.concatenate([middle - lengths[:, :2], middle + lengths[:, 2:]], axis=1)
        scores = 1 / (1 + np.exp(-logits[rows]))
        return _raw(boxes, scores, table[rows, 5:].argmax(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class CenterRows:
    """Rows of middle, size, and a score for each class: `(1, n, 4 + nc)`, or with objectness.

    Ultralytics v5 and YOLOX give `(1, n, 5 + nc)`, v8 and v11 `(1, 4 + nc, n)` (`is_turned`).
    `grid` are the cells of the input where middles and sizes are relative to those, as in YOLOX.
    """

    has_objectness: bool
    is_turned: bool = False
    grid: Cells | None = None

    def decode(self, outputs: list[Array], least: float) -> RawBoxes:
        """Return the boxes with scores of at least `least`."""
        table = outputs[0][0].T if self.is_turned else outputs[0][0]
        first = 5 if self.has_objectness else 4
        classes = table[:, first:].argmax(axis=1)
        scores = table[np.arange(len(table)), first + classes]
        if self.has_objectness:
            scores = scores * table[:, 4]
        rows = np.flatnonzero(scores >= least)
        middle, size = table[rows, :2], table[rows, 2:4]
        if self.grid is not None:
            centers, strides = self.grid
            stride = strides[rows, np.newaxis]
            middle = centers[rows] + (middle - 0.5) * stride  # offsets from the cell's corner
            size = np.exp(np.minimum(size, 20)) * stride
        boxes = np.concatenate([middle - size / 2, middle + size / 2], axis=1)
        return _raw(boxes, scores[rows], classes[rows])


@dataclass(frozen=True, slots=True)
class FinalRows:
    """Rows of x1, y1, x2, y2, score, class, after suppression: `(1, n, 6)`."""

    def decode(self, outputs: list[Array], least: float) -> RawBoxes:
        """Return the boxes with scores of at least `least`; empty rows have score 0."""
        table = outputs[0][0]
        table = table[table[:, 4] >= least]
        return _raw(table[:, :4], table[:, 4], table[:, 5])


@dataclass(frozen=True, slots=True)
class NamedColumns:
    """RT-DETR: outputs `labels`, `boxes` and `scores`; `order` has their places in this order."""

    order: tuple[int, int, int]

    def decode(self, outputs: list[Array], least: float) -> RawBoxes:
        """Return the boxes with scores of at least `least`."""
        labels, boxes, scores = (outputs[place][0] for place in self.order)
        rows = np.flatnonzero(scores >= least)
        return _raw(boxes[rows], scores[rows], labels[rows])


def cell_count(width: int, height: int) -> int:
    """Return the number of cells of all levels."""
    return sum((width // stride) * (height // stride) for stride in STRIDES)


def cell_centers(width: int, height: int) -> Cells:
    """Return the middle and the stride of all cells of an input."""
    centers, strides = [], []
    for stride in STRIDES:
        y, x = np.mgrid[: height // stride, : width // stride]
        centers.append((np.stack([x.ravel(), y.ravel()], axis=1) + 0.5) * stride)
        strides.append(np.full(x.size, stride))
    return np.concatenate(centers).astype(np.float32), np.concatenate(strides).astype(np.float32)


def _raw(boxes: Array, scores: Array, classes: Array) -> RawBoxes:
    return RawBoxes(
        boxes.astype(np.float32).reshape(-1, 4),
        np.clip(scores.astype(np.float32), 0, 1),
        classes.astype(np.int32),
    )
