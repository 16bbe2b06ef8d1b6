"""Search of a grid whose windows share no blocks: they share what lies before.

Each strip is resized and its gradients are computed once (`HOGDescriptor.compute` at locations).
Windows whose position at patch scale has another fraction of a pixel lie on another strip.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from vdet.detect.svm.dense.histogram import table_sums
from vdet.detect.svm.dense.hog import channel_of
from vdet.detect.svm.dense.strips import Strip
from vdet.detect.svm.dense.weights import DenseWeights
from vdet.detect.svm.features import Layout, Vectors, hog_descriptor
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.scored import Numbers, Scored
from vdet.detect.svm.windows import WindowGrid, every_nth
from vdet.geometry import Float32Array
from vdet.media.images import Image

BATCH = 8192
"""Windows described before they are scored: more would only take memory."""


@dataclass(frozen=True, slots=True)
class _Phase:
    """The windows on one strip: their numbers in the grid, and their places in the strip."""

    strip: Strip
    numbers: Numbers
    x: Numbers
    y: Numbers


class LocatedSearch:
    """Scores a grid of any step."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._tables = DenseWeights.of(model).tables
        self._windows = len(grid)
        self._phases = list(_phases(grid, model))
        side = model.features.patch
        self._hog = hog_descriptor(model.features, (side, side))

    def search(self, frame: FramePyramid) -> Scored:
        """Score each window."""
        probabilities = np.zeros(self._windows, np.float32)
        strips: list[Image] = []
        for phase in self._phases:
            strip = phase.strip.cut(frame)
            strips.append(strip)
            for i in range(0, len(phase.numbers), BATCH):
                some = slice(i, i + BATCH)
                scores = self._scores(strip, phase.x[some], phase.y[some])
                probabilities[phase.numbers[some]] = self._model.probabilities_of_scores(scores)
        return Scored(probabilities, lambda numbers: self._hogs(strips, numbers))

    def _hogs(self, strips: list[Image], numbers: Numbers) -> Vectors:
        """Describe some windows, each on its own strip."""
        hogs = np.zeros((len(numbers), Layout.of(self._model.features).hog_length), np.float32)
        for phase, strip in zip(self._phases, strips, strict=True):
            asked, theirs = np.nonzero(numbers[:, np.newaxis] == phase.numbers)
            if len(asked):
                hogs[asked] = self._describe(strip, phase.x[theirs], phase.y[theirs])
        return hogs

    def _scores(self, strip: Image, x: Numbers, y: Numbers) -> Float32Array:
        vectors = self._describe(strip, x, y)
        scores = vectors @ self._model.weights[:, : vectors.shape[1]].T + self._model.biases
        side = self._model.features.patch
        return np.asarray(scores + table_sums(strip, self._tables, side, x, y).T, np.float32)

    def _describe(self, strip: Image, x: Numbers, y: Numbers) -> Vectors:
        """Return the HOG of each window, float32 `(n, features)`, channel by channel."""
        locations = list(zip(x.tolist(), y.tolist(), strict=True))
        described = [
            self._hog.compute(channel_of(strip, number), locations=locations)
            for number in self._model.features.hog.channels
        ]
        return np.concatenate(
            [np.reshape(vectors, (len(locations), -1)) for vectors in described],
            axis=1,
            dtype=np.float32,
        )


def _phases(grid: WindowGrid, model: LinearModel) -> Iterator[_Phase]:
    """Split a grid into parts whose windows are whole patch pixels apart."""
    scale = Fraction(model.features.patch, grid.size)
    every = (grid.step * scale).denominator
    for down in range(min(every, grid.rows)):
        for across in range(min(every, grid.columns)):
            part = every_nth(grid, every, across, down)
            pixels = int(part.step * scale)
            row, column = np.divmod(np.arange(len(part)), part.columns)
            numbers = (row * every + down) * grid.columns + column * every + across
            yield _Phase(Strip(part, model.features), numbers, column * pixels, row * pixels)
