"""HOG of a whole strip, and the weighted sum of the blocks of each window in it.

A descriptor whose window is the strip gives every block once, block column by block column; the
window at a block position is a square of neighbouring blocks.
"""

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import as_strided

from vdet.config.schema import FeatureSettings
from vdet.detect.svm.features import Vectors, hog_descriptor
from vdet.geometry import Float32Array
from vdet.media.images import Image

Positions = npt.NDArray[np.intp]


def describe_blocks(strip: Image, features: FeatureSettings) -> Vectors:
    """Describe every block of a strip.

    Parameters
    ----------
    strip
        uint8 `(h, w, 3)` in the features' colour space; both sides whole numbers of cells.

    Returns
    -------
    float32 `(columns, rows, d)`, d the block's features channel by channel.
    """
    height, width = strip.shape[:2]
    hog = features.hog
    columns, rows = (side // hog.cell - hog.block + 1 for side in (width, height))
    descriptor = hog_descriptor(features, (width, height))
    blocks = [
        np.reshape(descriptor.compute(channel_of(strip, number)), (columns, rows, -1))
        for number in hog.channels
    ]
    return np.concatenate(blocks, axis=-1, dtype=np.float32)


def window_blocks(
    blocks: Vectors, columns: Positions, rows: Positions, features: FeatureSettings
) -> Vectors:
    """Return the HOG of chosen windows, as `FeatureExtractor` gives it.

    Parameters
    ----------
    blocks
        `(columns, rows, d)`, as from `describe_blocks`.
    columns, rows
        Block positions of the windows, `(m,)`.

    Returns
    -------
    float32 `(m, h)`, channel by channel.
    """
    channels = len(features.hog.channels)
    side = features.patch // features.hog.cell - features.hog.block + 1
    steps = np.arange(side)
    across = columns[:, np.newaxis, np.newaxis] + steps[:, np.newaxis]
    down = rows[:, np.newaxis, np.newaxis] + steps
    chosen = blocks[across, down].reshape(len(columns), side * side, channels, -1)
    return np.reshape(chosen.transpose(0, 2, 1, 3), (len(columns), -1))


def channel_of(strip: Image, number: int) -> Image:
    """Return one channel of a strip, contiguous `(h, w)`, as the descriptor needs it."""
    return np.ascontiguousarray(strip[:, :, number])


def window_sums(blocks: Vectors, weights: Float32Array) -> Float32Array:
    """Sum the weighted blocks of the window at each block position.

    Parameters
    ----------
    blocks
        `(columns, rows, d)`.
    weights
        `(m, b, b, d)`, for windows of b × b blocks.

    Returns
    -------
    float32 `(m, columns - b + 1, rows - b + 1)`.

    One matrix product gives every block's product with every weight slice: b² planes a member. A
    window's sum runs over the planes, each shifted by its own block position; with the planes laid
    flat, the shifts are constant strides.
    """
    columns, rows, length = blocks.shape
    members, side = weights.shape[:2]
    planes = weights.reshape(-1, length) @ blocks.reshape(-1, length).T
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
