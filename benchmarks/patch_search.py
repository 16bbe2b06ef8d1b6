"""The original's search: each window is cropped, resized, described and classified on its own.

It is slow and simple. The tests and benchmarks compare the dense search with it.
"""

import numpy as np

from vdet.boxes import Float32Array
from vdet.detect.svm.features import FeatureExtractor
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.windows import GridResult, IndexArray, WindowGrid

BATCH = 1024
"""Number of windows that are described before they are classified; it bounds the memory."""


class PatchSearch:
    """Searches the windows of one grid."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._boxes = grid.boxes
        self._extractor = FeatureExtractor(model.features)

    def search(self, frame: FramePyramid) -> GridResult:
        """Return the probability of each window."""
        indices = np.arange(len(self._boxes))
        batches = (indices[i : i + BATCH] for i in range(0, len(indices), BATCH))
        probabilities = [
            self._model.probabilities(self._describe(frame, batch)) for batch in batches
        ]
        length = self._extractor.layout.hog_length
        return GridResult(
            np.concatenate(probabilities), lambda hits: self._describe(frame, hits)[:, :length]
        )

    def _describe(self, frame: FramePyramid, indices: IndexArray) -> Float32Array:
        side = self._model.features.patch
        vectors = []
        for x, y, width, height in self._boxes[indices].tolist():
            patch = frame.cut(slice(y, y + height), slice(x, x + width), side, side)
            vectors.append(self._extractor.describe_channels(patch))
        return np.stack(vectors)
