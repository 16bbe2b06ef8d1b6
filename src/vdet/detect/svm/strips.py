"""Strips, the parts of a frame that the dense engine describes once for all windows in them.

A strip is what a grid covers, at the scale where a window is a patch. This module computes the HOG
blocks of a strip, and sums the model's weights over the windows in it: of HOG by a matrix product,
of colour histograms by look-up tables and integral images.
"""

import cv2
import numpy as np
from numpy.lib.stride_tricks import as_strided

from vdet.boxes import Float32Array
from vdet.config.svm import FeatureSettings
from vdet.detect.svm.features import Channels, hog_descriptor
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.windows import IndexArray


def block_weights(model: LinearModel) -> Float32Array:
    """Return the weights of HOG in the order of `describe_blocks`, float32 `(m, b, b, d)`.

    A window has b × b blocks, by column and row, of d features, channel by channel; `m` is the
    number of members of the model.
    """
    features, members = model.features, len(model.weights)
    weights = model.weights[:, : features.hog_length]
    side = features.blocks
    by_channel = weights.reshape(members, 3, side, side, -1)
    return np.moveaxis(by_channel, 1, 3).reshape(members, side, side, -1)


def histogram_tables(model: LinearModel) -> Float32Array:
    """Return what a pixel adds to the decision value, by member, channel and value.

    float32 `(m, 3, 256)`; it is the share of the colour histogram.
    """
    weights = model.weights[:, model.features.hog_length :]
    bins = model.features.histogram.bins
    return np.repeat(weights.reshape(-1, 3, bins), 256 // bins, axis=2)


def describe_blocks(strip: Channels, features: FeatureSettings) -> Float32Array:
    """Compute the HOG features of every block of a strip.

    Parameters
    ----------
    strip
        Channels in the features' colour space; both sides are whole numbers of cells.

    Returns
    -------
    float32 `(columns, rows, d)`, `d` features of a block, channel by channel.
    """
    height, width = (side * features.shrink(0) for side in strip[0].shape)
    hog = features.hog
    columns, rows = (side // hog.cell - hog.block + 1 for side in (width, height))
    # A descriptor whose window is the strip gives each block once, column by column.
    vectors = [
        hog_descriptor(features, (width, height), number).compute(channel)
        for number, channel in enumerate(strip)
    ]
    blocks = [np.reshape(vector, (columns, rows, -1)) for vector in vectors]
    return np.concatenate(blocks, axis=-1, dtype=np.float32)


def window_blocks(
    blocks: Float32Array, columns: IndexArray, rows: IndexArray, features: FeatureSettings
) -> Float32Array:
    """Return the HOG features of windows in the order of `FeatureExtractor`.

    Parameters
    ----------
    blocks
        `(columns, rows, d)`, as from `describe_blocks`.
    columns, rows
        The first block of each window, `(n,)`.

    Returns
    -------
    float32 `(n, h)`, channel by channel.
    """
    steps = np.arange(features.blocks)
    across = columns[:, np.newaxis, np.newaxis] + steps[:, np.newaxis]
    down = rows[:, np.newaxis, np.newaxis] + steps
    count, length = len(columns), blocks.shape[2] // 3
    by_block = blocks[across, down].reshape(count, features.blocks**2, 3, length)
    return np.reshape(by_block.transpose(0, 2, 1, 3), (count, features.hog_length))


def block_sums(
    blocks: Float32Array, weights: Float32Array, columns: IndexArray, rows: IndexArray
) -> Float32Array:
    """Sum the weighted blocks of windows of b × b blocks.

    One matrix product weights every block as if it lay in each place of a window: b² planes a
    member. The sum of a window takes one value of each plane, that of the block which lies there.

    Parameters
    ----------
    blocks
        `(columns, rows, d)`.
    weights
        `(m, b, b, d)`.
    columns, rows
        The first block of each window, `(n,)`.

    Returns
    -------
    float32 `(m, n)`.
    """
    wide, high, length = blocks.shape
    members, side = weights.shape[:2]
    planes = weights.reshape(-1, length) @ blocks.reshape(-1, length).T
    planes = planes.reshape(members, side, side, wide * high)
    # Block (i, j) of the window that begins at block k is block k + i·high + j. A view whose planes
    # begin that much later has all values of a window in the same place, and can be summed.
    member, i, j, item = planes.strides
    reach = (side - 1) * (high + 1)
    shifted = as_strided(
        planes,
        (members, side, side, wide * high - reach),
        (member, i + high * item, j + item, item),
        writeable=False,
    )
    sums: Float32Array = shifted.sum(axis=(1, 2))
    return sums[:, columns * high + rows]


def table_sums(
    strip: Channels,
    tables: Float32Array,
    features: FeatureSettings,
    x: IndexArray,
    y: IndexArray,
) -> Float32Array:
    """Sum look-up tables over the pixels of windows.

    Parameters
    ----------
    strip
        Channels in the features' colour space.
    tables
        float32 `(m, 3, 256)`.
    x, y
        Top-left pixels of the windows in the strip, `(n,)`.

    Returns
    -------
    float32 `(m, n)`.
    """
    sums = np.zeros((len(tables), len(x)), np.float32)
    for number, channel in enumerate(strip):
        shrink = features.shrink(number)
        left, top, side = x // shrink, y // shrink, features.patch // shrink
        for member, table in enumerate(tables[:, number]):
            integral = np.asarray(cv2.integral(cv2.LUT(channel, table)))
            inner = integral[top + side, left + side] - integral[top, left + side]
            sums[member] += inner - integral[top + side, left] + integral[top, left]
    return sums
