"""The reference engine: every window cropped, resized, described and scored on its own.

Slow and plain; faster engines are held to what it gives. Source: seed section 2.
"""

import numpy as np

from vdet.features import FeatureExtractor, to_patch
from vdet.model import LinearModel
from vdet.search.pyramid import FramePyramid
from vdet.windows import Boxes, Floats, WindowGrid

BATCH = 1024
"""Windows described before they are scored: more would only take memory."""


class PatchSearch:
    """Scores the windows of one grid, all inside the frame."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._boxes = grid.boxes
        self._extractor = FeatureExtractor(model.features)

    def search(self, frame: FramePyramid) -> Floats:
        """Return each window's probability, float32 `(n,)`."""
        batches = range(0, len(self._boxes), BATCH)
        return np.concatenate([self._score(frame, self._boxes[i : i + BATCH]) for i in batches])

    def _score(self, frame: FramePyramid, boxes: Boxes) -> Floats:
        side = self._model.features.patch
        crops = (frame.image[y : y + h, x : x + w] for x, y, w, h in boxes.tolist())
        vectors = self._extractor.describe_all(to_patch(crop, side) for crop in crops)
        return self._model.probabilities(vectors)
