"""A model's weights, sorted by what the dense engine multiplies them with."""

from dataclasses import dataclass

import numpy as np

from vdet.config.schema import FeatureSettings
from vdet.features import Layout
from vdet.model import LinearModel
from vdet.windows import Floats


@dataclass(frozen=True, slots=True)
class DenseWeights:
    """The weights of a model's `m` members.

    `hog` is float32 `(m, blocks, blocks, d)`, blocks by column and row, `d` the features of a block
    in all described channels, one after the other. `tables` is float32 `(m, 256, 3)`: what a pixel
    of each value adds, channel by channel.
    """

    hog: Floats
    tables: Floats

    @staticmethod
    def of(model: LinearModel) -> "DenseWeights":
        """Sort a model's weights."""
        layout, features = Layout.of(model.features), model.features
        hog = [_blocks(model.weights[:, part], features) for part in layout.hog]
        tables = _tables(model.weights[:, layout.histogram], features.histogram.bins)
        return DenseWeights(np.concatenate(hog, axis=-1), tables)


def _blocks(weights: Floats, features: FeatureSettings) -> Floats:
    blocks = features.patch // features.hog.cell - features.hog.block + 1
    return weights.reshape(len(weights), blocks, blocks, -1)


def _tables(weights: Floats, bins: int) -> Floats:
    if not bins:
        return np.zeros((len(weights), 256, 3), np.float32)
    by_channel = weights.reshape(len(weights), 3, bins)
    return np.ascontiguousarray(np.repeat(by_channel, 256 // bins, axis=2).transpose(0, 2, 1))
