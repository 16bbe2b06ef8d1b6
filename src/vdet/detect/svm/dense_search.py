"""The dense engine: a strip of the frame is described once for all the windows in it.

Windows that are whole cells apart share their HOG blocks. A grid of which every second window is
whole cells apart is searched as four such grids. The windows of any other grid share only resizing
and gradients.
"""

from typing import Any

import numpy as np

from vdet.boxes import Float32Array
from vdet.detect.svm import strips
from vdet.detect.svm.features import Channels, patch_descriptors
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.windows import WINDOW_SIDES, GridResult, IndexArray, WindowGrid

MAX_PHASES = 2
"""Most grids of shared blocks, across and down, that a grid is split into; with more of them,
sharing only the gradients is faster."""
BATCH = 8192
"""Number of windows that are described before they are classified; it bounds the memory."""


class DenseSearch:
    """Searches the windows of one grid, split into parts whose windows lie on the same strip."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        features = model.features
        pixels = grid.step * features.patch / grid.size  # from window to window, of the patch
        n = (pixels / features.hog.cell).denominator
        part: type[_Part] = _AlignedPart
        if n > MAX_PHASES:
            part = _LocatedPart
            n = (pixels / max(map(features.shrink, range(3)))).denominator
        self._model = model
        self._numbers = np.arange(len(grid)).reshape(grid.rows, grid.columns)
        self._parts = [
            (self._numbers[row::n, column::n].ravel(), part(model, grid.every_nth(n, column, row)))
            for row in range(min(n, grid.rows))
            for column in range(min(n, grid.columns))
        ]

    def search(self, frame: FramePyramid, probability: float) -> GridResult:
        """Search a frame; windows of at least this probability are hits."""
        probabilities = np.zeros(self._numbers.size, np.float32)
        sides = np.tile(WINDOW_SIDES, (self._numbers.size, 1))
        regression = self._model.box_regression
        for numbers, part in self._parts:
            strip = frame.cut(*part.strip)
            described = part.describe(strip)
            found = self._model.to_probabilities(part.values(strip, described))
            probabilities[numbers] = found
            (hits,) = np.nonzero(found >= probability)
            if regression is not None and len(hits):
                sides[numbers[hits]] = regression.sides(part.hogs(described, hits))
        return GridResult(probabilities, sides)


class _Part:
    """`n` windows that lie at whole pixels of one strip, in each channel of a patch."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model, self._features = model, model.features
        self._tables = strips.histogram_tables(model)
        self.strip = grid.strip(self._features.patch)
        row, column = np.divmod(np.arange(len(grid)), grid.columns)
        pixels = int(grid.step * self._features.patch / grid.size)
        self._x, self._y = column * pixels, row * pixels

    def values(self, strip: Channels, described: Any) -> Float32Array:
        """Return the decision values of the `m` members of the model, `(n, m)`."""
        of_colours = strips.table_sums(strip, self._tables, self._features, self._x, self._y)
        return (self._hog_values(described) + of_colours).T + self._model.biases

    def describe(self, strip: Channels) -> Any:
        """Return what all windows of the strip share."""
        raise NotImplementedError

    def hogs(self, described: Any, places: IndexArray) -> Float32Array:
        """Return the HOG features of some of the windows, by their indices."""
        raise NotImplementedError

    def _hog_values(self, described: Any) -> Float32Array:
        """Return the share of HOG in the decision values, `(m, n)`."""
        raise NotImplementedError


class _AlignedPart(_Part):
    """Windows that are whole cells apart. They share the HOG blocks of the strip."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        super().__init__(model, grid)
        self._weights = strips.block_weights(model)
        cell = self._features.hog.cell
        self._columns, self._rows = self._x // cell, self._y // cell

    def describe(self, strip: Channels) -> Float32Array:
        return strips.describe_blocks(strip, self._features)

    def hogs(self, described: Float32Array, places: IndexArray) -> Float32Array:
        columns, rows = self._columns[places], self._rows[places]
        return strips.window_blocks(described, columns, rows, self._features)

    def _hog_values(self, described: Float32Array) -> Float32Array:
        return strips.block_sums(described, self._weights, self._columns, self._rows)


class _LocatedPart(_Part):
    """Other windows. They share the gradients of the strip (`HOGDescriptor.compute`)."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        super().__init__(model, grid)
        self._descriptors = patch_descriptors(self._features)
        self._weights = model.weights[:, : self._features.hog_length]

    def describe(self, strip: Channels) -> Channels:
        return strip

    def hogs(self, described: Channels, places: IndexArray) -> Float32Array:
        parts = []
        for number, (hog, channel) in enumerate(zip(self._descriptors, described, strict=True)):
            shrink = self._features.shrink(number)
            x, y = self._x[places] // shrink, self._y[places] // shrink
            vectors = hog.compute(channel, locations=list(zip(x.tolist(), y.tolist(), strict=True)))
            parts.append(np.reshape(vectors, (len(places), -1)))
        return np.concatenate(parts, axis=1, dtype=np.float32)

    def _hog_values(self, described: Channels) -> Float32Array:
        places = np.arange(len(self._x))
        batches = (places[first : first + BATCH] for first in range(0, len(places), BATCH))
        values = [self.hogs(described, batch) @ self._weights.T for batch in batches]
        return np.concatenate(values).T
