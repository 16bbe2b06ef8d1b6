"""The search of one frame size: window sets laid over the frame, each scored by an engine."""

import logging
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from vdet.config.scaling import scale_lengths
from vdet.config.schema import FeatureSettings, SearchSettings, Settings
from vdet.detect.svm.dense import dense_search, why_not_dense
from vdet.detect.svm.horizon import USUAL
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.patch_search import PatchSearch
from vdet.detect.svm.perspective import lay_perspective
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.scored import Scored
from vdet.detect.svm.windows import Boxes, WindowGrid, Windows, lay_grid
from vdet.errors import ConfigError, ImageError
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
    """Scores all windows of frames of one size; holds nothing that a search changes.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    horizon
        Its row, share of the frames' height, for the sets that follow the perspective.

    Attributes
    ----------
    grids
        The window sets, laid over the frame.

    Raises
    ------
    ImageError
        No search window fits into such a frame, or more than `MAX_WINDOWS` do.
    ConfigError
        The dense engine is asked for, and the model's features cannot be computed densely.
    """

    def __init__(
        self,
        model: LinearModel,
        settings: Settings,
        width: int,
        height: int,
        *,
        horizon: float = USUAL,
    ) -> None:
        self.grids = grids = tuple(
            lay_grids(settings, model.features, width, height, horizon=horizon)
        )
        if not grids:
            raise ImageError(
                f"no search window fits into a frame of {width}×{height} pixels; "
                "give a larger one, or other search.windows"
            )
        if (count := sum(map(len, grids))) > MAX_WINDOWS:
            raise ImageError(
                f"{count:,} search windows would be laid over a frame of {width}×{height} pixels, "
                f"more than {MAX_WINDOWS:,}; give search.windows larger steps, or fewer rows"
            )
        grid_search = dense_search if _is_dense(settings.search, model.features) else PatchSearch
        searches = [grid_search(model, grid) for grid in grids]
        turns = min(settings.search.alternate, len(grids))
        self._turns = [
            _SetSearch(model, settings, grids[i::turns], searches[i::turns]) for i in range(turns)
        ]
        self._whole = _SetSearch(model, settings, grids, searches)

    def search(self, image: Image, turn: int | None = None) -> Windows:
        """Score windows of a frame, BGR uint8 `(H, W, 3)`; may be called from threads.

        Parameters
        ----------
        turn
            Number of a video's frame: only the sets whose turn it is are searched
            (`search.alternate`). None for all of them.
        """
        sets = self._whole if turn is None else self._turns[turn % len(self._turns)]
        return sets.search(image)


class _SetSearch:
    """Scores the windows of some sets."""

    def __init__(
        self,
        model: LinearModel,
        settings: Settings,
        grids: Sequence[WindowGrid],
        searches: Sequence[GridSearch],
    ) -> None:
        self._searches = searches
        self._grid_boxes = [grid.boxes for grid in grids]
        self._boxes = np.concatenate(self._grid_boxes)
        self._shares = np.repeat(
            np.array([grid.share for grid in grids], np.float32), [len(grid) for grid in grids]
        )
        self._least = settings.search.probability
        self._regression = model.boxes
        top, bottom = self._boxes[:, 1].min(), (self._boxes[:, 1] + self._boxes[:, 3]).max()
        self._rows = int(top) // _MULTIPLE * _MULTIPLE, int(bottom)
        self._margin = -(int(self._boxes[:, 0].min()) // _MULTIPLE * _MULTIPLE)

    def search(self, image: Image) -> Windows:
        frame = FramePyramid(image, *self._rows, margin=self._margin)
        found = [search.search(frame) for search in self._searches]
        vehicles = [self._vehicles(*each) for each in zip(found, self._grid_boxes, strict=True)]
        probabilities = np.concatenate([scored.probabilities for scored in found])
        return Windows(self._boxes, probabilities, self._shares, np.concatenate(vehicles))

    def _vehicles(self, scored: Scored, boxes: Boxes) -> Float32Array:
        """Return the windows themselves, detections replaced by the vehicles that they show."""
        vehicles = boxes.astype(np.float32)
        (hits,) = np.nonzero(scored.probabilities >= self._least)
        if self._regression is not None and len(hits):
            sides = self._regression.sides(scored.hogs(hits))
            vehicles[hits] = _placed(vehicles[hits], sides)
        return vehicles


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
    settings: Settings,
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
