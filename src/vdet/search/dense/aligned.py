"""Search of grids whose windows step by whole cells, all or every n-th: they share their blocks."""

import numpy as np

from vdet.model import LinearModel
from vdet.search.dense.histogram import table_sums
from vdet.search.dense.hog import describe_blocks, window_sums
from vdet.search.dense.strips import Strip
from vdet.search.dense.weights import DenseWeights
from vdet.search.pyramid import FramePyramid
from vdet.windows import Floats, WindowGrid, every_nth


class AlignedSearch:
    """Scores a grid that steps by whole cells, across and down."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._weights = DenseWeights.of(model)
        self._strip = Strip(grid, model.features)
        cell = model.features.hog.cell
        self._cells = int(grid.step * model.features.patch / grid.size / cell)
        self._x = np.arange(grid.columns)[:, np.newaxis] * self._cells * cell
        self._y = np.arange(grid.rows)[np.newaxis] * self._cells * cell

    def search(self, frame: FramePyramid) -> Floats:
        """Return each window's probability, float32 `(n,)`."""
        features = self._model.features
        strip = self._strip.cut(frame)
        every_block = window_sums(describe_blocks(strip, features), self._weights.hog)
        scores = every_block[:, :: self._cells, :: self._cells]
        scores = scores + table_sums(strip, self._weights.tables, features.patch, self._x, self._y)
        by_row = scores.transpose(2, 1, 0).reshape(-1, len(scores))
        return self._model.probabilities_of_scores(by_row + self._model.biases)


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

    def search(self, frame: FramePyramid) -> Floats:
        """Return each window's probability, float32 `(n,)`."""
        probabilities = np.zeros(self._shape, np.float32)
        for (down, across), part in self._parts.items():
            place = probabilities[down :: self._every, across :: self._every]
            place[:] = part.search(frame).reshape(place.shape)
        return probabilities.ravel()
