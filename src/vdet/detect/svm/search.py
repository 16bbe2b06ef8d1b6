"""The search of one frame size: window sets laid over the frame, each scored by an engine."""

import logging
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from vdet.config.schema import FeatureSettings, SearchSettings, SvmSettings
from vdet.config.section import scale_lengths
from vdet.detect.svm.dense import dense_search, why_not_dense
from vdet.detect.svm.horizon import USUAL
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.patch_search import PatchSearch
from vdet.detect.svm.perspective import lay_perspective
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.scored import Scored
from vdet.detect.svm.windows import WindowGrid, Windows, lay_grid
from vdet.errors import ConfigError, FrameSizeError, ImageError
from vdet.geometry import Float32Array
from vdet.media.images import Image

MAX_WINDOWS = 100_000
"""In a frame; more take minutes. The shipped settings lay about 2,700 over a frame of 16:9."""

_MULTIPLE = 16  # of rows and columns, so that the pyramid's levels begin at whole pixels

log = logging.getLogger("vdet")


class GridSearch(Protocol):
    """Scores the windows of one grid."""

    def search(self, frame: FramePyramid) -> Scored:
        """Score each window."""


class FrameSearch:
    """Scores the windows of frames of one size; nothing in it changes, so threads may share it.

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
        No search window fits into such a frame.
    ImageError
        More than `MAX_WINDOWS` windows fit.
    ConfigError
        The dense engine is asked for, and the model's features cannot be computed densely.
    """

    def __init__(
        self,
        model: LinearModel,
        settings: SvmSettings,
        width: int,
        height: int,
        *,
        horizon: float = USUAL,
    ) -> None:
        grids = tuple(lay_grids(settings, model.features, width, height, horizon=horizon))
        if not grids:
            raise FrameSizeError(
                f"no search window fits into a frame of {width}×{height} pixels; "
                "give a larger one, or other detector.search.windows"
            )
        if (count := sum(map(len, grids))) > MAX_WINDOWS:
            raise ImageError(
                f"{count:,} search windows would be laid over a frame of {width}×{height} pixels, "
                f"more than {MAX_WINDOWS:,}; give detector.search.windows larger steps, or fewer "
                "rows"
            )
        search_grid = dense_search if _is_dense(settings.search, model.features) else PatchSearch
        self.grids = grids
        self._sets = [_WindowSet(grid, search_grid(model, grid)) for grid in grids]
        self._turns = min(settings.search.alternate, len(grids))
        self._least = settings.search.probability
        self._regression = model.boxes

    def sets_of(self, index: int) -> range:
        """Return the numbers of the sets that are searched in a video's frame `index`."""
        return range(index % self._turns, len(self._sets), self._turns)

    def search(self, image: Image, sets: Sequence[int] | None = None) -> list[Windows]:
        """Score the windows of some sets in a frame, BGR uint8 `(H, W, 3)`; None for all sets."""
        chosen = self._sets if sets is None else [self._sets[number] for number in sets]
        top = min(each.top for each in chosen) // _MULTIPLE * _MULTIPLE
        margin = -(min(each.left for each in chosen) // _MULTIPLE * _MULTIPLE)
        frame = FramePyramid(image, top, max(each.bottom for each in chosen), margin=margin)
        return [self._windows(each, each.search.search(frame)) for each in chosen]

    def _windows(self, window_set: "_WindowSet", scored: Scored) -> Windows:
        boxes = window_set.boxes
        vehicles = boxes.astype(np.float32)
        (hits,) = np.nonzero(scored.probabilities >= self._least)
        if self._regression is not None and len(hits):
            sides = self._regression.sides(scored.hogs(hits))
            vehicles[hits] = _placed(vehicles[hits], sides)
        return Windows(boxes, scored.probabilities, window_set.shares, vehicles)


class _WindowSet:
    """A grid, its search, and what of its windows is the same in every frame."""

    def __init__(self, grid: WindowGrid, search: GridSearch) -> None:
        self.search = search
        self.boxes = grid.boxes
        self.shares = np.full(len(grid), grid.share, np.float32)
        self.left, self.top = self.boxes[:, :2].min(axis=0).tolist()
        self.bottom = int((self.boxes[:, 1] + self.boxes[:, 3]).max())


def _placed(windows: Float32Array, sides: Float32Array) -> Float32Array:
    """Turn sides, relative to their windows, into boxes; a box has at least `_LEAST` of a window.

    `windows` `(m, 4)` are x, y, width, height; `sides` `(m, 4)` left, top, right, bottom from the
    window's centre in its sides.
    """
    size = windows[:, 2:]
    middle = windows[:, :2] + size / 2
    extent = np.maximum(sides[:, 2:] - sides[:, :2], _LEAST)
    centre = middle + (sides[:, :2] + sides[:, 2:]) / 2 * size
    return np.concatenate([centre - extent * size / 2, extent * size], axis=1, dtype=np.float32)


_LEAST = 0.2
"""Width and height of the smallest vehicle that a window can show, sides of the window."""


def lay_grids(
    settings: SvmSettings,
    features: FeatureSettings,
    width: int,
    height: int,
    *,
    horizon: float = USUAL,
) -> list[WindowGrid]:
    """Lay the window sets over a frame; those of which no window fits are left out."""
    search = scale_lengths(settings.search, height / settings.reference_height)
    cells = features.patch // features.hog.cell
    grids = [lay_grid(each, width, height, cells=cells) for each in search.windows]
    grids += lay_perspective(search.perspective, features, width, height, horizon=horizon)
    return [grid for grid in grids if len(grid)]


def _is_dense(search: SearchSettings, features: FeatureSettings) -> bool:
    if search.engine == "patch":
        return False
    reason = why_not_dense(features)
    if reason and search.engine == "dense":
        raise ConfigError(f"search.engine: dense cannot compute {reason}; take auto or patch")
    if reason:
        log.info("the patch engine searches: the dense one cannot compute %s", reason)
    return not reason
