"""The reference engine: every window cropped, resized, described and scored on its own.

Slow and plain; faster engines are held to what it gives. Source: seed section 2.
"""

import numpy as np

from vdet.features import FeatureExtractor, to_patch
from vdet.model import LinearModel
from vdet.search.pyramid import FramePyramid
from vdet.search.scored import Scored
from vdet.windows import WindowGrid


class PatchSearch:
    """Scores the windows of one grid."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._boxes = grid.boxes
        self._extractor = FeatureExtractor(model.features)

    def search(self, frame: FramePyramid) -> Scored:
        """Score each window."""
        side, layout = self._model.features.patch, self._extractor.layout
        vectors = np.empty((len(self._boxes), layout.length), np.float32)
        for i, box in enumerate(self._boxes.tolist()):
            vectors[i] = self._extractor.describe(to_patch(frame.crop(*box), side))
        probabilities = self._model.probabilities(vectors)
        return Scored(probabilities, lambda numbers: vectors[numbers, : layout.hog_length])
