"""The search of one frame size: window sets laid over the frame, scored by an engine."""

from typing import Protocol

import numpy as np

from vdet.config.scaling import scale_lengths
from vdet.config.schema import SearchSettings, Settings
from vdet.errors import ImageError
from vdet.images import Image
from vdet.model import LinearModel
from vdet.search.patch import PatchSearch
from vdet.windows import Boxes, Windows, positions


class SearchEngine(Protocol):
    """Scores all windows of a frame."""

    def search(self, image: Image) -> Windows:
        """Score every window of a frame, BGR uint8 `(H, W, 3)`."""


def make_search(model: LinearModel, settings: Settings, width: int, height: int) -> SearchEngine:
    """Prepare the search of frames of `width` × `height` pixels.

    Raises
    ------
    ImageError
        No search window fits into such a frame.
    """
    search = scale_lengths(settings.search, height / settings.reference_height)
    boxes = np.concatenate(lay_windows(search, width, height))
    if not len(boxes):
        raise ImageError(
            f"no search window fits into a frame of {width}×{height} pixels; "
            "give a larger one, or other search.windows"
        )
    return PatchSearch(model, boxes)


def lay_windows(search: SearchSettings, width: int, height: int) -> list[Boxes]:
    """Return each set's windows that lie inside the frame; lengths already scaled to it."""
    sets = [positions(settings, width) for settings in search.windows]
    return [boxes[boxes[:, 1] + boxes[:, 3] <= height] for boxes in sets]
