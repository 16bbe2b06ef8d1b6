"""The original's search: each window is cropped, resized, described and classified on its own.

It is slow and simple. The tests and benchmarks compare the dense search with it.
"""

import numpy as np

from vdet.boxes import Float32Array
from vdet.detect.svm.model import LinearModel, describe
from vdet.detect.svm.windows import WINDOW_SIDES, FramePyramid, FrameStrip, WindowGrid


class PatchSearch:
    """Searches the windows of one grid."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._boxes = grid.boxes.tolist()

    def search(self, frame: FramePyramid, probability: float) -> tuple[Float32Array, Float32Array]:
        """Search a frame as `DenseSearch.search`."""
        side, regression = self._model.features.patch, self._model.box_regression
        patches = (
            frame.cut(FrameStrip(slice(y, y + height), slice(x, x + width), side, side))
            for x, y, width, height in self._boxes
        )
        vectors = np.stack([describe(patch, self._model.features) for patch in patches])
        probabilities = self._model.probabilities(vectors)
        sides = np.tile(WINDOW_SIDES, (len(vectors), 1))
        if regression is not None:
            hits = probabilities >= probability
            sides[hits] = regression.sides(vectors[hits, : self._model.features.hog_length])
        return probabilities, sides
