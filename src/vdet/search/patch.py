"""The reference engine: every window cropped, resized, described and scored on its own.

Slow and plain; faster engines are held to what it gives. Source: seed section 2.
"""

import numpy as np

from vdet.features import FeatureExtractor, to_patch
from vdet.model import LinearModel
from vdet.search.pyramid import FramePyramid
from vdet.windows import Floats, WindowGrid


class PatchSearch:
    """Scores the windows of one grid, all inside the frame."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._boxes = grid.boxes
        self._extractor = FeatureExtractor(model.features)

    def search(self, frame: FramePyramid) -> Floats:
        """Return each window's probability, float32 `(n,)`."""
        side = self._model.features.patch
        vectors = np.empty((len(self._boxes), self._extractor.layout.length), np.float32)
        for i, (x, y, width, height) in enumerate(self._boxes.tolist()):
            crop = frame.image[y : y + height, x : x + width]
            vectors[i] = self._extractor.describe(to_patch(crop, side))
        return self._model.probabilities(vectors)
