"""The search of frames of one size: each window set is laid over the frame and searched."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from vdet.boxes import Float32Array
from vdet.config.schema import SvmSettings
from vdet.detect.svm.dense_search import DenseSearch
from vdet.detect.svm.horizon import DEFAULT_HORIZON
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.windows import GridResult, WindowGrid, Windows, lay_grids
from vdet.errors import FrameSizeError, ImageError
from vdet.media import Picture

MAX_WINDOWS = 100_000
"""Maximum number of windows in a frame; more take minutes. The shipped settings lay about 2,700."""

_ALIGNMENT = 16
"""The searched part begins at a multiple of this many pixels of the frame, so that it can be halved
as the windows in it are."""

_MIN_SIDE = 0.2  # of the smallest vehicle that a window can show, sides of the window


class GridSearch(Protocol):
    """An engine for the windows of one grid."""

    def search(self, frame: FramePyramid, probability: float) -> GridResult:
        """Search a frame; windows of at least this probability are hits."""


Engine = Callable[[LinearModel, WindowGrid], GridSearch]
"""Makes the search of a grid."""


class FrameSearch:
    """Searches the windows of frames of one size; it has no state, so threads may share it.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    horizon
        Row of the horizon, fraction of the frames' height, for the sets that follow the
        perspective.

    Attributes
    ----------
    grids
        The window sets, laid over the frame.

    Raises
    ------
    FrameSizeError
        No window fits into such a frame.
    ImageError
        More than `MAX_WINDOWS` windows fit.
    """

    def __init__(
        self,
        model: LinearModel,
        settings: SvmSettings,
        width: int,
        height: int,
        *,
        horizon: float = DEFAULT_HORIZON,
        engine: Engine = DenseSearch,
    ) -> None:
        self.grids = tuple(lay_grids(settings, model.features, width, height, horizon=horizon))
        if not self.grids:
            raise FrameSizeError(f"no search window fits into {width}×{height} pixels")
        if (count := sum(map(len, self.grids))) > MAX_WINDOWS:
            raise ImageError(
                f"{count:,} windows in {width}×{height} pixels are too many; use larger steps"
            )
        self._searches = [engine(model, grid) for grid in self.grids]
        self._boxes = np.concatenate([grid.boxes for grid in self.grids])
        self._shares = np.repeat(
            np.array([grid.share for grid in self.grids], np.float32), list(map(len, self.grids))
        )
        left, top = self._boxes[:, :2].min(axis=0).tolist()
        right, self._bottom = (self._boxes[:, :2] + self._boxes[:, 2:]).max(axis=0).tolist()
        self._top = top // _ALIGNMENT * _ALIGNMENT
        self._margin = -(-max(-left, right - width, 0) // _ALIGNMENT) * _ALIGNMENT
        self._probability = settings.search.probability
        self._features = model.features

    def search(self, picture: Picture) -> Windows:
        """Search a frame; return the windows of all sets, in the order of `grids`."""
        frame = FramePyramid(picture, self._features, self._top, self._bottom, self._margin)
        results = [search.search(frame, self._probability) for search in self._searches]
        probabilities = np.concatenate([result.probabilities for result in results])
        sides = np.concatenate([result.sides for result in results])
        vehicles = _vehicle_boxes(self._boxes.astype(np.float32), sides)
        return Windows(self._boxes, probabilities, self._shares, vehicles)


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
