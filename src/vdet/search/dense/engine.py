"""Which kind of dense search a grid gets."""

import numpy as np

from vdet.config.schema import FeatureSettings
from vdet.images import Image
from vdet.model import LinearModel
from vdet.search.dense.aligned import AlignedSearch
from vdet.search.dense.located import LocatedSearch, every_nth
from vdet.search.dense.weights import DenseWeights
from vdet.windows import Floats, WindowGrid

MOST_PHASES = 2
"""Across and down. Beyond, describing a strip once a phase costs more than window by window."""


def why_not_dense(features: FeatureSettings) -> str | None:
    """Say what keeps these features from being computed densely; None where nothing does."""
    if features.spatial.size:
        return "features.spatial"
    if not features.hog.channels:
        return "features without HOG"
    return None


def dense_search(
    model: LinearModel, grid: WindowGrid, *, cascade: bool
) -> "AlignedSearch | PhasedSearch | LocatedSearch":
    """Return the fastest search of a grid that has windows."""
    weights = DenseWeights.of(model, cascade=cascade)
    features = model.features
    step = grid.step * features.patch / grid.size / features.hog.cell
    if step.denominator == 1:
        return AlignedSearch(model, weights, grid, step.numerator)
    if step.denominator <= MOST_PHASES:
        return PhasedSearch(model, weights, grid, step.denominator)
    return LocatedSearch(model, weights, grid)


class PhasedSearch:
    """Scores a grid of which every n-th window steps by whole cells, as n² aligned grids."""

    def __init__(
        self, model: LinearModel, weights: DenseWeights, grid: WindowGrid, every: int
    ) -> None:
        self._shape = (grid.rows, grid.columns)
        self._every = every
        cells = int(grid.step * every * model.features.patch / grid.size / model.features.hog.cell)
        self._parts = {
            (down, across): AlignedSearch(
                model, weights, every_nth(grid, every, across, down), cells
            )
            for down in range(min(every, grid.rows))
            for across in range(min(every, grid.columns))
        }

    def search(self, image: Image) -> Floats:
        """Return each window's probability, float32 `(n,)`, in a frame, BGR uint8 `(H, W, 3)`."""
        probabilities = np.zeros(self._shape, np.float32)
        n = self._every
        for (down, across), part in self._parts.items():
            place = probabilities[down::n, across::n]
            place[:] = part.search(image).reshape(place.shape)
        return probabilities.ravel()
