"""A model's weights, sorted by what the dense engine multiplies them with."""

from dataclasses import dataclass

import numpy as np

from vdet.config.schema import FeatureSettings
from vdet.detect.svm.features import Layout
from vdet.detect.svm.model import LinearModel
from vdet.geometry import Float32Array


@dataclass(frozen=True, slots=True)
class DenseWeights:
    """The weights of a model's `m` members.

    `hog` is float32 `(m, blocks, blocks, d)`, blocks by column and row, `d` the features of a block
    in all described channels, one after the other. `tables` is float32 `(m, 256, 3)`: what a pixel
    of each value adds, channel by channel.
    """

    hog: Float32Array
    tables: Float32Array

    @staticmethod
    def of(model: LinearModel) -> "DenseWeights":
        """Sort a model's weights."""
        layout, features = Layout.of(model.features), model.features
        hog = [_blocks(model.weights[:, part], features) for part in layout.hog]
        tables = _tables(model.weights[:, layout.histogram], features.histogram.bins)
        return DenseWeights(np.concatenate(hog, axis=-1), tables)


def _blocks(weights: Float32Array, features: FeatureSettings) -> Float32Array:
    blocks = features.patch // features.hog.cell - features.hog.block + 1
    return weights.reshape(len(weights), blocks, blocks, -1)


def _tables(weights: Float32Array, bins: int) -> Float32Array:
    if not bins:
        return np.zeros((len(weights), 256, 3), np.float32)
    by_channel = weights.reshape(len(weights), 3, bins)
    return np.ascontiguousarray(np.repeat(by_channel, 256 // bins, axis=2).transpose(0, 2, 1))
