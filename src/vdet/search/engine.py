"""The search of one frame size: window sets laid over the frame, each scored by an engine."""

import logging
from typing import Protocol

import numpy as np

from vdet.config.scaling import scale_lengths
from vdet.config.schema import FeatureSettings, SearchSettings, Settings
from vdet.errors import ConfigError, ImageError
from vdet.images import Image
from vdet.model import LinearModel
from vdet.search.dense import dense_search, why_not_dense
from vdet.search.patch import PatchSearch
from vdet.search.pyramid import FramePyramid
from vdet.windows import Floats, WindowGrid, Windows, lay_grid

MAX_WINDOWS = 100_000
"""In a frame; more take minutes. The shipped settings lay about 1,500 over a frame of 16:9."""

_ROW_MULTIPLE = 16  # so that the pyramid's levels begin at whole pixels

log = logging.getLogger("vdet")


class GridSearch(Protocol):
    """Scores the windows of one grid."""

    def search(self, frame: FramePyramid) -> Floats:
        """Return each window's probability, float32 `(n,)`."""


class FrameSearch:
    """Scores all windows of frames of one size; holds nothing that a search changes.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.

    Raises
    ------
    ImageError
        No search window fits into such a frame, or more than `MAX_WINDOWS` do.
    ConfigError
        The dense engine is asked for, and the model's features cannot be computed densely.
    """

    def __init__(self, model: LinearModel, settings: Settings, width: int, height: int) -> None:
        grids = lay_grids(settings, model.features, width, height)
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
        dense = _is_dense(settings.search, model.features)
        self._searches: list[GridSearch] = [
            dense_search(model, grid) if dense else PatchSearch(model, grid) for grid in grids
        ]
        self._boxes = np.concatenate([grid.boxes for grid in grids])
        top, bottom = self._boxes[:, 1].min(), (self._boxes[:, 1] + self._boxes[:, 3]).max()
        self._rows = int(top) // _ROW_MULTIPLE * _ROW_MULTIPLE, int(bottom)
        self._shares = np.repeat(
            np.array([grid.share for grid in grids], np.float32), [len(grid) for grid in grids]
        )

    def search(self, image: Image) -> Windows:
        """Score every window of a frame, BGR uint8 `(H, W, 3)`; may be called from threads."""
        frame = FramePyramid(image, *self._rows)
        probabilities = np.concatenate([search.search(frame) for search in self._searches])
        return Windows(self._boxes, probabilities, self._shares)


def lay_grids(
    settings: Settings, features: FeatureSettings, width: int, height: int
) -> list[WindowGrid]:
    """Lay the window sets over a frame; those of which no window fits are left out."""
    search = scale_lengths(settings.search, height / settings.reference_height)
    cells = features.patch // features.hog.cell
    grids = [lay_grid(each, width, height, cells=cells) for each in search.windows]
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
