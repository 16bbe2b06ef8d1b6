"""The dense engine: a strip of the frame is described once for all the windows in it.

Windows that are whole cells apart share their HOG blocks (`AlignedSearch`). A grid of which every
second window is whole cells apart is searched as four such grids (`PhasedSearch`). The windows of
any other grid share only resizing and gradients (`LocatedSearch`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from vdet.boxes import Float32Array
from vdet.detect.svm.features import Channels, Layout, patch_descriptors
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.strips import (
    Strip,
    StripWeights,
    block_sums,
    describe_blocks,
    table_sums,
    window_blocks,
)
from vdet.detect.svm.windows import GridResult, IndexArray, WindowGrid

MAX_PHASES = 2
"""Of `PhasedSearch`, across and down. With more, `LocatedSearch` is faster."""
BATCH = 8192
"""Number of windows that are described before they are classified; it bounds the memory."""


def dense_search(
    model: LinearModel, grid: WindowGrid
) -> "AlignedSearch | PhasedSearch | LocatedSearch":
    """Return the fastest search of a grid that has windows."""
    features = model.features
    cells = grid.step * features.patch / grid.size / features.hog.cell
    if cells.denominator == 1:
        return AlignedSearch(model, grid)
    if cells.denominator <= MAX_PHASES:
        return PhasedSearch(model, grid, cells.denominator)
    return LocatedSearch(model, grid)


class AlignedSearch:
    """Searches a grid whose windows are whole cells apart, across and down."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._weights = StripWeights.of(model)
        self._strip = Strip(grid, model.features)
        self._columns = grid.columns
        cell = model.features.hog.cell
        self._cells = int(grid.step * model.features.patch / grid.size / cell)
        self._x = np.arange(grid.columns)[:, np.newaxis] * self._cells * cell
        self._y = np.arange(grid.rows)[np.newaxis] * self._cells * cell

    def search(self, frame: FramePyramid) -> GridResult:
        """Return the probability of each window."""
        features = self._model.features
        strip = self._strip.cut(frame)
        blocks = describe_blocks(strip, features)
        at_every_block = block_sums(blocks, self._weights.hog)
        values = at_every_block[:, :: self._cells, :: self._cells]
        values = values + table_sums(strip, self._weights.tables, features, self._x, self._y)
        by_row = values.transpose(2, 1, 0).reshape(-1, len(values))
        probabilities = self._model.to_probabilities(by_row + self._model.biases)
        return GridResult(probabilities, lambda indices: self._hogs(blocks, indices))

    def _hogs(self, blocks: Float32Array, indices: IndexArray) -> Float32Array:
        rows, columns = np.divmod(indices, self._columns)
        return window_blocks(
            blocks, columns * self._cells, rows * self._cells, self._model.features
        )


class PhasedSearch:
    """Searches a grid of which every n-th window is whole cells apart, as n² aligned grids."""

    def __init__(self, model: LinearModel, grid: WindowGrid, n: int) -> None:
        self._shape = (grid.rows, grid.columns)
        self._n = n
        self._parts = {
            (row, column): AlignedSearch(model, grid.every_nth(n, column, row))
            for row in range(min(n, grid.rows))
            for column in range(min(n, grid.columns))
        }

    def search(self, frame: FramePyramid) -> GridResult:
        """Return the probability of each window."""
        probabilities = np.zeros(self._shape, np.float32)
        results = {}
        for (row, column), part in self._parts.items():
            results[row, column] = result = part.search(frame)
            place = probabilities[row :: self._n, column :: self._n]
            place[:] = result.probabilities.reshape(place.shape)
        return GridResult(probabilities.ravel(), lambda indices: self._hogs(results, indices))

    def _hogs(
        self, results: dict[tuple[int, int], GridResult], indices: IndexArray
    ) -> Float32Array:
        """Return the HOG features of some windows, each from its part."""
        rows, columns = np.divmod(indices, self._shape[1])
        hogs: list[Float32Array] = []
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
            (j, first_row), (i, first_column) = divmod(row, self._n), divmod(column, self._n)
            width = len(range(first_column, self._shape[1], self._n))
            hogs.append(results[first_row, first_column].hogs(np.array([j * width + i])))
        return np.concatenate(hogs)


@dataclass(frozen=True, slots=True)
class _Phase:
    """The windows of a grid that lie on one strip: their indices, and their pixels in the strip."""

    strip: Strip
    indices: IndexArray
    x: IndexArray
    y: IndexArray


class LocatedSearch:
    """Searches a grid of any step.

    A strip is resized and its gradients are computed once (`HOGDescriptor.compute` with locations).
    Windows lie on the same strip if they are whole pixels of each of its channels apart.
    """

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._tables = StripWeights.of(model).tables
        self._windows = len(grid)
        self._phases = list(_phases(grid, model))
        self._descriptors = patch_descriptors(model.features)

    def search(self, frame: FramePyramid) -> GridResult:
        """Return the probability of each window."""
        probabilities = np.zeros(self._windows, np.float32)
        strips: list[Channels] = []
        for phase in self._phases:
            strip = phase.strip.cut(frame)
            strips.append(strip)
            for i in range(0, len(phase.indices), BATCH):
                batch = slice(i, i + BATCH)
                values = self._decision_values(strip, phase.x[batch], phase.y[batch])
                probabilities[phase.indices[batch]] = self._model.to_probabilities(values)
        return GridResult(probabilities, lambda indices: self._hogs(strips, indices))

    def _hogs(self, strips: list[Channels], indices: IndexArray) -> Float32Array:
        """Describe some windows, each on its own strip."""
        hogs = np.zeros((len(indices), Layout.of(self._model.features).hog_length), np.float32)
        for phase, strip in zip(self._phases, strips, strict=True):
            rows, places = np.nonzero(indices[:, np.newaxis] == phase.indices)
            if len(rows):
                hogs[rows] = self._describe(strip, phase.x[places], phase.y[places])
        return hogs

    def _decision_values(self, strip: Channels, x: IndexArray, y: IndexArray) -> Float32Array:
        hogs = self._describe(strip, x, y)
        values = hogs @ self._model.weights[:, : hogs.shape[1]].T + self._model.biases
        sums = table_sums(strip, self._tables, self._model.features, x, y)
        return np.asarray(values + sums.T, np.float32)

    def _describe(self, strip: Channels, x: IndexArray, y: IndexArray) -> Float32Array:
        """Return the HOG features of each window, float32 `(n, h)`, channel by channel."""
        described = [np.zeros((len(x), 0), np.float32)]  # all there is without HOG
        for number, hog in self._descriptors.items():
            shrink = self._model.features.shrink(number)
            places = zip((x // shrink).tolist(), (y // shrink).tolist(), strict=True)
            vectors = hog.compute(strip[number], locations=list(places))
            described.append(np.reshape(vectors, (len(x), -1)))
        return np.concatenate(described, axis=1, dtype=np.float32)


def _phases(grid: WindowGrid, model: LinearModel) -> Iterator[_Phase]:
    """Split a grid into parts whose windows are whole pixels apart, in each channel of a patch."""
    scale = Fraction(model.features.patch, grid.size)
    n = (grid.step * scale / max(map(model.features.shrink, range(3)))).denominator
    for first_row in range(min(n, grid.rows)):
        for first_column in range(min(n, grid.columns)):
            part = grid.every_nth(n, first_column, first_row)
            pixels = int(part.step * scale)
            row, column = np.divmod(np.arange(len(part)), part.columns)
            indices = (row * n + first_row) * grid.columns + column * n + first_column
            yield _Phase(Strip(part, model.features), indices, column * pixels, row * pixels)
