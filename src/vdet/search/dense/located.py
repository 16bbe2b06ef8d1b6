"""Search of a grid whose windows share no blocks: they share what lies before.

Each strip is resized and its gradients are computed once (`HOGDescriptor.compute` at locations).
Windows whose position at patch scale has another fraction of a pixel lie on another strip.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from vdet.features import hog_descriptor
from vdet.images import Image
from vdet.model import LinearModel
from vdet.search.dense.histogram import table_sums
from vdet.search.dense.strips import Strip, channel_of
from vdet.search.dense.weights import DenseWeights
from vdet.windows import Floats, WindowGrid

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class _Phase:
    """The windows on one strip: their numbers in the grid, and their places in the strip."""

    strip: Strip
    numbers: Indices
    x: Indices
    y: Indices


class LocatedSearch:
    """Scores a grid of any step."""

    def __init__(self, model: LinearModel, weights: DenseWeights, grid: WindowGrid) -> None:
        self._model = model
        self._weights = weights
        self._windows = len(grid)
        self._phases = list(_phases(grid, model))
        side = model.features.patch
        self._hog = hog_descriptor(model.features, (side, side))

    def search(self, image: Image) -> Floats:
        """Return each window's probability, float32 `(n,)`, in a frame, BGR uint8 `(H, W, 3)`.

        It is 0 for a window that the first stage has dropped.
        """
        probabilities = np.zeros(self._windows, np.float32)
        for phase in self._phases:
            probabilities[phase.numbers] = self._search_phase(phase, image)
        return probabilities

    def _search_phase(self, phase: _Phase, image: Image) -> Floats:
        strip = phase.strip.cut(image)
        side = self._model.features.patch
        scores = table_sums(strip, self._weights.tables, side, phase.x, phase.y)
        scores += self._weights.biases[:, np.newaxis]
        everyone = np.arange(len(phase.numbers))
        self._add_hog(scores, strip, 0, phase, everyone)
        possible = everyone
        if self._weights.has_first_stage:
            possible = np.nonzero(scores[-1] >= 0)[0]
        members = scores[: self._weights.members]
        for number in range(1, len(self._weights.hog)):
            self._add_hog(members, strip, number, phase, possible)
        probabilities = np.zeros(len(everyone), np.float32)
        probabilities[possible] = self._model.probabilities_of_scores(members[:, possible].T)
        return probabilities

    def _add_hog(
        self, scores: Floats, strip: Image, number: int, phase: _Phase, wanted: Indices
    ) -> None:
        """Add a channel's part to the scores `(m, n)` of the wanted windows."""
        if not len(wanted):
            return
        channel = channel_of(strip, self._model.features.hog.channels[number])
        locations = list(zip(phase.x[wanted].tolist(), phase.y[wanted].tolist(), strict=True))
        vectors = np.asarray(self._hog.compute(channel, locations=locations), np.float32)
        weights = self._weights.hog[number][: len(scores)].reshape(len(scores), -1)
        scores[:, wanted] += weights @ vectors.reshape(len(wanted), -1).T


def _phases(grid: WindowGrid, model: LinearModel) -> Iterator[_Phase]:
    """Split a grid into parts whose windows are whole patch pixels apart."""
    scale = Fraction(model.features.patch, grid.size)
    every = (grid.step * scale).denominator
    for down in range(min(every, grid.rows)):
        for across in range(min(every, grid.columns)):
            part = every_nth(grid, every, across, down)
            pixels = int(part.step * scale)
            row, column = np.divmod(np.arange(len(part)), part.columns)
            numbers = (row * every + down) * grid.columns + column * every + across
            yield _Phase(Strip(part, model.features), numbers, column * pixels, row * pixels)


def every_nth(grid: WindowGrid, n: int, across: int, down: int) -> WindowGrid:
    """Return the grid of every n-th window, from column `across` and row `down` on."""
    return WindowGrid(
        grid.size,
        grid.step * n,
        grid.left + across * grid.step,
        grid.top + down * grid.step,
        len(range(across, grid.columns, n)),
        len(range(down, grid.rows, n)),
    )
