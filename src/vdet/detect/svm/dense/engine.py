"""Which kind of dense search a grid gets."""

from vdet.config.schema import FeatureSettings
from vdet.detect.svm.dense.aligned import AlignedSearch, PhasedSearch
from vdet.detect.svm.dense.located import LocatedSearch
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.windows import WindowGrid

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
    model: LinearModel, grid: WindowGrid
) -> AlignedSearch | PhasedSearch | LocatedSearch:
    """Return the fastest search of a grid that has windows."""
    features = model.features
    cells = grid.step * features.patch / grid.size / features.hog.cell
    if cells.denominator == 1:
        return AlignedSearch(model, grid)
    if cells.denominator <= MOST_PHASES:
        return PhasedSearch(model, grid, cells.denominator)
    return LocatedSearch(model, grid)
