"""A model's weights, sorted by what the dense engine multiplies them with."""

from dataclasses import dataclass

import numpy as np

from vdet.config.schema import FeatureSettings
from vdet.features import Layout
from vdet.model import LinearModel
from vdet.windows import Floats


@dataclass(frozen=True, slots=True)
class DenseWeights:
    """Weights of `m` linear scores: the model's members, then its first stage if it has one.

    `hog` has one float32 array `(m, blocks, blocks, block features)` a described channel, blocks
    by column and row; the first stage's part is zero beyond the first channel. `tables` is float32
    `(m, 256, 3)`: what a pixel of each value adds, channel by channel. `biases` is `(m,)`.
    """

    hog: tuple[Floats, ...]
    tables: Floats
    biases: Floats
    members: int

    @staticmethod
    def of(model: LinearModel, *, cascade: bool) -> "DenseWeights":
        """Sort a model's weights; without `cascade` its first stage is left out."""
        layout = Layout.of(model.features)
        weights, biases = model.weights, model.biases
        if cascade and model.first_stage:
            row = np.zeros((1, layout.length), np.float32)
            row[0, layout.first_stage] = model.first_stage.weights
            weights = np.concatenate([weights, row])
            biases = np.concatenate([biases, model.first_stage.bias])
        return DenseWeights(
            tuple(_blocks(weights[:, part], model.features) for part in layout.hog),
            _tables(weights[:, layout.histogram], model.features.histogram.bins),
            biases,
            len(model.biases),
        )

    @property
    def has_first_stage(self) -> bool:
        """Whether the last score is the first stage's."""
        return len(self.biases) > self.members


def _blocks(weights: Floats, features: FeatureSettings) -> Floats:
    blocks = features.patch // features.hog.cell - features.hog.block + 1
    return weights.reshape(len(weights), blocks, blocks, -1)


def _tables(weights: Floats, bins: int) -> Floats:
    if not bins:
        return np.zeros((len(weights), 256, 3), np.float32)
    by_channel = weights.reshape(len(weights), 3, bins)
    return np.ascontiguousarray(np.repeat(by_channel, 256 // bins, axis=2).transpose(0, 2, 1))
