"""The search of one frame size: window sets laid over the frame, each searched by an engine."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from vdet.boxes import Float32Array
from vdet.config.schema import FeatureSettings, SvmSettings
from vdet.config.section import REFERENCE_HEIGHT, scale_lengths
from vdet.detect.svm.dense_search import dense_search
from vdet.detect.svm.horizon import DEFAULT_HORIZON
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.windows import (
    ALIGNMENT,
    GridResult,
    WindowGrid,
    Windows,
    join_windows,
    lay_grid,
    lay_perspective,
    limited_grid,
)
from vdet.errors import FrameSizeError, ImageError
from vdet.media import Picture
from vdet.regions import SearchArea

MAX_WINDOWS = 100_000
"""In a frame; more take minutes. The shipped settings lay about 2,700 over a frame of 16:9."""

_MIN_SIDE = 0.2  # of the smallest vehicle that a window can show, sides of the window


class GridSearch(Protocol):
    """An engine for the windows of one grid."""

    def search(self, frame: FramePyramid) -> GridResult:
        """Return the probability of each window."""


Engine = Callable[[LinearModel, WindowGrid], GridSearch]
"""Makes the search of a grid."""


class FrameSearch:
    """Searches the windows of frames of one size; it has no state, so threads may share it.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    horizon
        Row of the horizon, share of the frames' height, for the sets that follow the perspective.

    Attributes
    ----------
    grids
        The window sets, laid over the frame.

    Raises
    ------
    FrameSizeError
        No window fits into such a frame.
    ImageError
        More than `MAX_WINDOWS` windows fit, or none reaches `area`.
    """

    def __init__(
        self,
        model: LinearModel,
        settings: SvmSettings,
        width: int,
        height: int,
        *,
        horizon: float = DEFAULT_HORIZON,
        area: SearchArea | None = None,
        engine: Engine = dense_search,
    ) -> None:
        grids = tuple(lay_grids(settings, model.features, width, height, horizon=horizon))
        if not grids:
            raise FrameSizeError(
                f"no search window fits into a frame of {width}×{height} pixels; give a larger "
                "frame, or smaller windows in detector.search.windows or "
                "detector.search.perspective.sizes"
            )
        if (count := sum(map(len, grids))) > MAX_WINDOWS:
            raise ImageError(
                f"{count:,} search windows would be laid over a frame of {width}×{height} pixels, "
                f"more than {MAX_WINDOWS:,}; give larger steps or fewer rows in "
                "detector.search.windows and detector.search.perspective"
            )
        parts = [limited_grid(grid, area, model.features) if area else grid for grid in grids]
        self.grids = tuple(part for part in parts if part is not None)
        if not self.grids:
            raise ImageError("no search window reaches the regions; make them larger, or lower")
        self._sets = [
            _WindowSet(part, engine(model, part), grid.share)
            for grid, part in zip(grids, parts, strict=True)
            if part
        ]
        self._top = min(each.top for each in self._sets) // ALIGNMENT * ALIGNMENT
        self._bottom = max(each.bottom for each in self._sets)
        beyond = max(max(-each.left, each.right - width, 0) for each in self._sets)
        self._margin = -(-beyond // ALIGNMENT) * ALIGNMENT
        self._probability = settings.search.probability
        self._regression = model.box_regression
        self._features = model.features

    def search(self, picture: Picture) -> Windows:
        """Search a frame; return the windows of all sets, in the order of `grids`."""
        frame = FramePyramid(picture, self._features, self._top, self._bottom, margin=self._margin)
        found = [self._windows(each, each.search.search(frame)) for each in self._sets]
        return join_windows(found)

    def _windows(self, window_set: "_WindowSet", result: GridResult) -> Windows:
        boxes = window_set.boxes
        vehicles = boxes.astype(np.float32)
        (hits,) = np.nonzero(result.probabilities >= self._probability)
        if self._regression is not None and len(hits):
            sides = self._regression.sides(result.hogs(hits))
            vehicles[hits] = _vehicle_boxes(vehicles[hits], sides)
        return Windows(boxes, result.probabilities, window_set.shares, vehicles)


class _WindowSet:
    """A grid, its search, and what is the same in every frame."""

    def __init__(self, grid: WindowGrid, search: GridSearch, share: float) -> None:
        self.search = search
        self.boxes = grid.boxes
        self.shares = np.full(len(grid), share, np.float32)
        self.left, self.top = self.boxes[:, :2].min(axis=0).tolist()
        self.right, self.bottom = (self.boxes[:, :2] + self.boxes[:, 2:]).max(axis=0).tolist()


def _vehicle_boxes(windows: Float32Array, sides: Float32Array) -> Float32Array:
    """Return the boxes of vehicles in windows, `(m, 4)` of x, y, width, height.

    Parameters
    ----------
    windows
        `(m, 4)` of x, y, width, height.
    sides
        `(m, 4)` of left, top, right, bottom, measured from the centre of the window in its sides.
    """
    size = windows[:, 2:]
    middle = windows[:, :2] + size / 2
    extent = np.maximum(sides[:, 2:] - sides[:, :2], _MIN_SIDE)
    centre = middle + (sides[:, :2] + sides[:, 2:]) / 2 * size
    return np.concatenate([centre - extent * size / 2, extent * size], axis=1, dtype=np.float32)


def lay_grids(
    settings: SvmSettings,
    features: FeatureSettings,
    width: int,
    height: int,
    *,
    horizon: float = DEFAULT_HORIZON,
) -> list[WindowGrid]:
    """Lay the window sets over a frame; sets of which no window fits are left out."""
    search = scale_lengths(settings.search, height / REFERENCE_HEIGHT)
    cells = features.patch // features.hog.cell
    grids = [lay_grid(each, width, height, cells=cells) for each in search.windows]
    grids += lay_perspective(search.perspective, features, width, height, horizon=horizon)
    return [grid for grid in grids if len(grid)]
