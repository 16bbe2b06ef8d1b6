"""Search of a grid whose windows step by whole cells: they share their blocks."""

import numpy as np

from vdet.images import Image
from vdet.model import LinearModel
from vdet.search.dense.histogram import table_sums
from vdet.search.dense.hog import describe_blocks, window_sums
from vdet.search.dense.strips import Strip, channel_of, spans
from vdet.search.dense.weights import DenseWeights
from vdet.windows import Floats, WindowGrid


class AlignedSearch:
    """Scores a grid that steps by `cells` cells, across and down."""

    def __init__(
        self, model: LinearModel, weights: DenseWeights, grid: WindowGrid, cells: int
    ) -> None:
        self._model = model
        self._weights = weights
        self._grid = grid
        self._cells = cells
        self._strip = Strip(grid, model.features)
        step = cells * model.features.hog.cell
        self._x = np.arange(grid.columns)[:, np.newaxis] * step
        self._y = np.arange(grid.rows)[np.newaxis] * step

    def search(self, image: Image) -> Floats:
        """Return each window's probability, float32 `(n,)`, in a frame, BGR uint8 `(H, W, 3)`.

        It is 0 for a window that the first stage has dropped.
        """
        strip = self._strip.cut(image)
        patch = self._model.features.patch
        scores = table_sums(strip, self._weights.tables, patch, self._x, self._y)
        scores += self._weights.biases[:, np.newaxis, np.newaxis]
        self._add_hog(scores, strip, 0, 0, self._grid.columns)
        possible = np.ones(scores.shape[1:], bool)
        if self._weights.has_first_stage:
            possible = scores[-1] >= 0
        members = scores[: self._weights.members]
        reach = patch // self._model.features.hog.cell // self._cells
        for start, stop in spans(np.any(possible, axis=1), reach):
            for number in range(1, len(self._weights.hog)):
                self._add_hog(members, strip, number, start, stop)
        probabilities = np.zeros(possible.shape, np.float32)
        probabilities[possible] = self._model.probabilities_of_scores(members[:, possible].T)
        return probabilities.T.ravel()

    def _add_hog(self, scores: Floats, strip: Image, number: int, start: int, stop: int) -> None:
        """Add a channel's part to the scores `(m, columns, rows)` of some columns of windows."""
        features = self._model.features
        cell = features.hog.cell
        # A cell more on each side: gradients at the cut are then those of the whole strip.
        left = max(0, int(self._x[start, 0]) - cell)
        right = int(self._x[stop - 1, 0]) + features.patch + cell
        channel = channel_of(strip, features.hog.channels[number], left, right)
        weights = self._weights.hog[number][: len(scores)]
        sums = window_sums(describe_blocks(channel, features), weights)
        first = (int(self._x[start, 0]) - left) // cell
        columns = slice(first, first + (stop - start - 1) * self._cells + 1, self._cells)
        scores[:, start:stop] += sums[:, columns, :: self._cells]
