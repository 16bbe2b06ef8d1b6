"""The reference engine: every window cropped, resized, described and scored on its own.

Slow and plain; faster engines are held to what it gives. Source: seed section 2.
"""

import numpy as np

from vdet.features import FeatureExtractor, to_patch
from vdet.images import Image
from vdet.model import LinearModel
from vdet.windows import Boxes, Windows


class PatchSearch:
    """Scores the windows at `boxes`, `(n, 4)` x, y, width, height, all inside the frame."""

    def __init__(self, model: LinearModel, boxes: Boxes) -> None:
        self._model = model
        self._boxes = boxes
        self._extractor = FeatureExtractor(model.features)

    def search(self, image: Image) -> Windows:
        """Score every window of a frame, BGR uint8 `(H, W, 3)`."""
        side = self._model.features.patch
        vectors = np.empty((len(self._boxes), self._extractor.length), np.float32)
        for i, (x, y, width, height) in enumerate(self._boxes.tolist()):
            crop = image[y : y + height, x : x + width]
            vectors[i] = self._extractor.describe(to_patch(crop, side))
        return Windows(self._boxes, self._model.probabilities(vectors))
