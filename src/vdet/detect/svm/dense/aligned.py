"""Search of grids whose windows step by whole cells, all or every n-th: they share their blocks."""

import numpy as np

from vdet.detect.svm.dense.histogram import table_sums
from vdet.detect.svm.dense.hog import describe_blocks, window_blocks, window_sums
from vdet.detect.svm.dense.strips import Strip
from vdet.detect.svm.dense.weights import DenseWeights
from vdet.detect.svm.features import Vectors
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.scored import Numbers, Scored
from vdet.detect.svm.windows import WindowGrid, every_nth


class AlignedSearch:
    """Scores a grid that steps by whole cells, across and down."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._weights = DenseWeights.of(model)
        self._strip = Strip(grid, model.features)
        self._columns = grid.columns
        cell = model.features.hog.cell
        self._cells = int(grid.step * model.features.patch / grid.size / cell)
        self._x = np.arange(grid.columns)[:, np.newaxis] * self._cells * cell
        self._y = np.arange(grid.rows)[np.newaxis] * self._cells * cell

    def search(self, frame: FramePyramid) -> Scored:
        """Score each window."""
        features = self._model.features
        strip = self._strip.cut(frame)
        blocks = describe_blocks(strip, features)
        every_block = window_sums(blocks, self._weights.hog)
        scores = every_block[:, :: self._cells, :: self._cells]
        scores = scores + table_sums(strip, self._weights.tables, features.patch, self._x, self._y)
        by_row = scores.transpose(2, 1, 0).reshape(-1, len(scores))
        probabilities = self._model.probabilities_of_scores(by_row + self._model.biases)
        return Scored(probabilities, lambda numbers: self._hogs(blocks, numbers))

    def _hogs(self, blocks: Vectors, numbers: Numbers) -> Vectors:
        rows, columns = np.divmod(numbers, self._columns)
        return window_blocks(
            blocks, columns * self._cells, rows * self._cells, self._model.features
        )


class PhasedSearch:
    """Scores a grid of which every n-th window steps by whole cells, as n² aligned grids."""

    def __init__(self, model: LinearModel, grid: WindowGrid, every: int) -> None:
        self._shape = (grid.rows, grid.columns)
        self._every = every
        self._parts = {
            (down, across): AlignedSearch(model, every_nth(grid, every, across, down))
            for down in range(min(every, grid.rows))
            for across in range(min(every, grid.columns))
        }

    def search(self, frame: FramePyramid) -> Scored:
        """Score each window."""
        probabilities = np.zeros(self._shape, np.float32)
        scored = {}
        for (down, across), part in self._parts.items():
            scored[down, across] = found = part.search(frame)
            place = probabilities[down :: self._every, across :: self._every]
            place[:] = found.probabilities.reshape(place.shape)
        return Scored(probabilities.ravel(), lambda numbers: self._hogs(scored, numbers))

    def _hogs(self, scored: dict[tuple[int, int], Scored], numbers: Numbers) -> Vectors:
        """Ask the part that each window belongs to."""
        rows, columns = np.divmod(numbers, self._shape[1])
        vectors: list[Vectors] = []
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
            (down, j), (across, i) = self._part(row), self._part(column)
            width = len(range(across, self._shape[1], self._every))
            vectors.append(scored[down, across].hogs(np.array([j * width + i])))
        return np.concatenate(vectors)

    def _part(self, position: int) -> tuple[int, int]:
        """Return the phase of a row or column, and its number within that."""
        return position % self._every, position // self._every
