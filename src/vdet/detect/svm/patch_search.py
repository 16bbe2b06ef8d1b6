"""The reference engine: every window cropped, resized, described and scored on its own.

Slow and plain; faster engines are held to what it gives. Source: seed section 2.
"""

import numpy as np

from vdet.detect.svm.features import FeatureExtractor, Vectors, to_patch
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.scored import Numbers, Scored
from vdet.detect.svm.windows import WindowGrid

BATCH = 1024
"""Windows described before they are scored: more would only take memory."""


class PatchSearch:
    """Scores the windows of one grid."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._boxes = grid.boxes
        self._extractor = FeatureExtractor(model.features)

    def search(self, frame: FramePyramid) -> Scored:
        """Score each window."""
        numbers = np.arange(len(self._boxes))
        batches = (numbers[i : i + BATCH] for i in range(0, len(numbers), BATCH))
        vectors = (self._describe(frame, some) for some in batches)
        probabilities = [self._model.probabilities(some) for some in vectors]
        length = self._extractor.layout.hog_length
        return Scored(
            np.concatenate(probabilities), lambda hits: self._describe(frame, hits)[:, :length]
        )

    def _describe(self, frame: FramePyramid, numbers: Numbers) -> Vectors:
        side = self._model.features.patch
        crops = (frame.crop(*box) for box in self._boxes[numbers].tolist())
        return self._extractor.describe_all(to_patch(crop, side) for crop in crops)
