"""The dense engine: a strip of the frame is described once for all the windows in it.

Windows that are whole cells apart share their HOG blocks. A grid of which every second window is
whole cells apart is searched as four such grids. The windows of any other grid share only resizing
and gradients.
"""

from fractions import Fraction
from typing import Any

import numpy as np

from vdet.boxes import Float32Array
from vdet.detect.svm import strips
from vdet.detect.svm.features import Channels, Layout, patch_descriptors
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.windows import GridResult, IndexArray, WindowGrid

MAX_PHASES = 2
"""Most grids of shared blocks, across and down, that a grid is split into; with more of them,
sharing only the gradients is faster."""
BATCH = 8192
"""Number of windows that are described before they are classified; it bounds the memory."""


class DenseSearch:
    """Searches the windows of one grid, split into parts whose windows lie on the same strip."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        features = model.features
        pixels = grid.step * features.patch / grid.size  # from window to window, of the patch
        n = (pixels / features.hog.cell).denominator
        part: type[_Part] = _AlignedPart
        if n > MAX_PHASES:
            part = _LocatedPart
            n = (pixels / max(map(features.shrink, range(3)))).denominator
        self._numbers = np.arange(len(grid)).reshape(grid.rows, grid.columns)
        self._parts: list[tuple[IndexArray, _Part]] = []
        for row in range(min(n, grid.rows)):
            for column in range(min(n, grid.columns)):
                numbers = self._numbers[row::n, column::n].ravel()
                self._parts.append((numbers, part(model, grid.every_nth(n, column, row))))

    def search(self, frame: FramePyramid) -> GridResult:
        """Return the probability of each window."""
        probabilities = np.zeros(self._numbers.size, np.float32)
        seen = []
        for numbers, part in self._parts:
            values, described = part.search(frame)
            probabilities[numbers] = self._model.to_probabilities(values)
            seen.append(described)
        return GridResult(probabilities, lambda indices: self._hogs(seen, indices))

    def _hogs(self, seen: list[Any], indices: IndexArray) -> Float32Array:
        hogs = np.zeros((len(indices), Layout.of(self._model.features).hog_length), np.float32)
        for (numbers, part), described in zip(self._parts, seen, strict=True):
            rows, places = np.nonzero(indices[:, np.newaxis] == numbers)
            if len(rows):
                hogs[rows] = part.hogs(described, places)
        return hogs


class _AlignedPart:
    """Searches `n` windows that are whole cells apart, by a model with `m` members."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._weights, self._tables = strips.block_weights(model), strips.histogram_tables(model)
        self._strip = strips.Strip(grid, model.features)
        self._columns = grid.columns
        cell = model.features.hog.cell
        self._cells = int(grid.step * model.features.patch / grid.size / cell)
        self._x = np.arange(grid.columns)[:, np.newaxis] * self._cells * cell
        self._y = np.arange(grid.rows)[np.newaxis] * self._cells * cell

    def search(self, frame: FramePyramid) -> tuple[Float32Array, Float32Array]:
        """Return the decision values, `(n, m)`, and the HOG blocks of the strip."""
        features = self._model.features
        strip = self._strip.cut(frame)
        blocks = strips.describe_blocks(strip, features)
        values = strips.block_sums(blocks, self._weights)[:, :: self._cells, :: self._cells]
        values = values + strips.table_sums(strip, self._tables, features, self._x, self._y)
        by_row = values.transpose(2, 1, 0).reshape(-1, len(values))
        return by_row + self._model.biases, blocks

    def hogs(self, described: Float32Array, places: IndexArray) -> Float32Array:
        """Return the HOG features of some of the windows, by their indices."""
        rows, columns = np.divmod(places, self._columns)
        across, down = columns * self._cells, rows * self._cells
        return strips.window_blocks(described, across, down, self._model.features)


class _LocatedPart:
    """Searches `n` windows that are whole pixels apart, in each channel of a patch.

    The gradients of the strip are computed once (`HOGDescriptor.compute` with locations).
    """

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._tables = strips.histogram_tables(model)
        self._strip = strips.Strip(grid, model.features)
        row, column = np.divmod(np.arange(len(grid)), grid.columns)
        pixels = int(grid.step * Fraction(model.features.patch, grid.size))
        self._x, self._y = column * pixels, row * pixels
        self._descriptors = patch_descriptors(model.features)

    def search(self, frame: FramePyramid) -> tuple[Float32Array, Channels]:
        """Return the decision values, `(n, m)`, and the strip."""
        strip = self._strip.cut(frame)
        sums = strips.table_sums(strip, self._tables, self._model.features, self._x, self._y)
        values = sums.T + self._model.biases
        for first in range(0, len(values), BATCH):
            hogs = self.hogs(strip, np.arange(first, min(first + BATCH, len(values))))
            weights = self._model.weights[:, : hogs.shape[1]]
            values[first : first + BATCH] += hogs @ weights.T
        return values, strip

    def hogs(self, described: Channels, places: IndexArray) -> Float32Array:
        """Return the HOG features of some of the windows, by their indices."""
        parts = [np.zeros((len(places), 0), np.float32)]  # all there is without HOG
        for number, hog in self._descriptors.items():
            shrink = self._model.features.shrink(number)
            x, y = self._x[places] // shrink, self._y[places] // shrink
            locations = list(zip(x.tolist(), y.tolist(), strict=True))
            vectors = hog.compute(described[number], locations=locations)
            parts.append(np.reshape(vectors, (len(places), -1)))
        return np.concatenate(parts, axis=1, dtype=np.float32)


_Part = _AlignedPart | _LocatedPart
