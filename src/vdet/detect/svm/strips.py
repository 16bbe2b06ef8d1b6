"""Strips, the parts of a frame that the dense engine describes once for all windows in them.

A strip is what a grid covers, at the scale where a window is a patch. This module cuts strips,
computes their HOG blocks, and sums the model's weights over the windows in them: of HOG by a matrix
product, of colour histograms by look-up tables and integral images.
"""

from fractions import Fraction

import cv2
import numpy as np
from numpy.lib.stride_tricks import as_strided

from vdet.boxes import Float32Array
from vdet.config.svm import FeatureSettings
from vdet.detect.svm.features import Channels, Layout, hog_descriptor
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.windows import IndexArray, WindowGrid


class Strip:
    """Cuts a grid's strip out of frames.

    The strip begins at the grid's first window and ends with its last. The position of a window in
    it is its position in the grid times patch / size; the grids that are searched by strips have
    whole numbers there.
    """

    def __init__(self, grid: WindowGrid, features: FeatureSettings) -> None:
        self._columns, self._width = _extent(grid, features, grid.left, grid.columns)
        self._rows, self._height = _extent(grid, features, grid.top, grid.rows)

    def cut(self, frame: FramePyramid) -> Channels:
        """Return the strip of a frame, channels of `(h, w)`."""
        return frame.cut(self._rows, self._columns, self._width, self._height)


def _extent(
    grid: WindowGrid, features: FeatureSettings, first: Fraction, count: int
) -> tuple[slice, int]:
    """Return what `count` windows from `first` on cover in the frame, and their side of a strip."""
    span = (count - 1) * grid.step + grid.size
    start = round(first)
    return slice(start, start + round(span)), round(span * features.patch / grid.size)


def block_weights(model: LinearModel) -> Float32Array:
    """Return the weights of HOG in the order of `describe_blocks`, float32 `(m, b, b, d)`.

    A window has b × b blocks, by column and row, of d features, channel by channel; `m` is the
    number of members of the model.
    """
    features, members = model.features, len(model.weights)
    blocks = features.patch // features.hog.cell - features.hog.block + 1
    shape = members, blocks, blocks
    parts = [np.zeros((*shape, 0), np.float32)]  # all there is without HOG
    parts += [model.weights[:, part].reshape(*shape, -1) for part in Layout.of(features).hog]
    return np.concatenate(parts, axis=-1)


def histogram_tables(model: LinearModel) -> Float32Array:
    """Return what a pixel adds to the decision value, by member, channel and value.

    float32 `(m, 3, 256)`; it is the share of the colour histogram.
    """
    weights = model.weights[:, Layout.of(model.features).histogram]
    bins = model.features.histogram.bins
    if not bins:
        return np.zeros((len(weights), 3, 256), np.float32)
    return np.repeat(weights.reshape(len(weights), 3, bins), 256 // bins, axis=2)


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
    blocks = [np.zeros((columns, rows, 0), np.float32)]  # all there is without HOG
    for number in hog.channels:
        values = hog_descriptor(features, (width, height), number).compute(strip[number])
        blocks.append(np.reshape(values, (columns, rows, -1)))
    return np.concatenate(blocks, axis=-1, dtype=np.float32)


def window_blocks(
    blocks: Float32Array, columns: IndexArray, rows: IndexArray, features: FeatureSettings
) -> Float32Array:
    """Return the HOG features of some windows in the order of `FeatureExtractor`.

    Parameters
    ----------
    blocks
        `(columns, rows, d)`, as from `describe_blocks`.
    columns, rows
        Positions of the windows in `blocks`, `(m,)`.

    Returns
    -------
    float32 `(m, h)`, channel by channel.
    """
    channels = max(1, len(features.hog.channels))
    side = features.patch // features.hog.cell - features.hog.block + 1
    steps = np.arange(side)
    across = columns[:, np.newaxis, np.newaxis] + steps[:, np.newaxis]
    down = rows[:, np.newaxis, np.newaxis] + steps
    chosen = blocks[across, down].reshape(
        len(columns), side * side, channels, blocks.shape[2] // channels
    )
    length = side * side * blocks.shape[2]
    return np.reshape(chosen.transpose(0, 2, 1, 3), (len(columns), length))


def block_sums(blocks: Float32Array, weights: Float32Array) -> Float32Array:
    """Sum the weighted blocks of the window at each block position.

    One matrix product gives every block's product with every slice of the weights: b² planes a
    member. The sum of a window runs over the planes, each shifted by its own block position; in
    memory, these shifts are constant strides.

    Parameters
    ----------
    blocks
        `(columns, rows, d)`.
    weights
        `(m, b, b, d)`, for windows of b × b blocks.

    Returns
    -------
    float32 `(m, columns - b + 1, rows - b + 1)`.
    """
    columns, rows, length = blocks.shape
    members, side = weights.shape[:2]
    flat_weights = weights.reshape(members * side * side, length)
    planes = flat_weights @ blocks.reshape(columns * rows, length).T
    plane, item = columns * rows, planes.itemsize
    wide, high = columns - side + 1, rows - side + 1
    flat = (wide - 1) * rows + high
    strides = (side * side * plane, side * plane + rows, plane + 1, 1)
    shifted = as_strided(
        planes, (members, side, side, flat), [item * stride for stride in strides], writeable=False
    )
    sums = np.zeros((members, wide * rows), np.float32)
    np.sum(shifted, axis=(1, 2), out=sums[:, :flat])
    return sums.reshape(members, wide, rows)[:, :, :high]


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
        Top-left pixels of the windows in the strip, of shapes that broadcast.

    Returns
    -------
    float32 `(m, …)`, `…` being the broadcast shape of `x` and `y`.
    """
    sums = np.zeros((len(tables), *np.broadcast_shapes(x.shape, y.shape)), np.float32)
    for number, channel in enumerate(strip):
        shrink = features.shrink(number)
        left, top, side = x // shrink, y // shrink, features.patch // shrink
        for member, table in enumerate(tables[:, number]):
            integral = np.asarray(cv2.integral(cv2.LUT(channel, table)))
            inner = integral[top + side, left + side] - integral[top, left + side]
            sums[member] += inner - integral[top + side, left] + integral[top, left]
    return sums
