"""Which patches are learned from, with their augmented samples, and which are held out."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray, Float32Array
from vdet.learn.svm.extraction import LabelledVectors, SampleVectors

SplitName = Literal["random", "tail"]


def training_set(data: LabelledVectors, kept: BoolArray) -> SampleVectors:
    """Return the kept patches, bool `(n,)`, followed by the samples made of these."""
    sides = np.full((len(kept), 4), np.nan, np.float32) if data.sides is None else data.sides
    rows = np.cumsum(kept) - 1  # in the training set
    made = data.augmented
    if made is None:
        return SampleVectors(data.vectors[kept], data.vehicle[kept], sides[kept], rows[kept])
    used = kept[made.origins]
    return SampleVectors(
        _chosen([data.vectors, made.vectors], [kept, used]),
        np.concatenate([data.vehicle[kept], made.vehicle[used]]),
        np.concatenate([sides[kept], made.sides[used]]),
        np.concatenate([rows[kept], rows[made.origins[used]]]),
    )


def _chosen(parts: Sequence[Float32Array], chosen: Sequence[BoolArray]) -> Float32Array:
    """Join the chosen rows of all parts, without any other copy of them."""
    rows = [np.flatnonzero(each) for each in chosen]
    joined = np.empty((sum(map(len, rows)), parts[0].shape[1]), np.float32)
    start = 0
    for part, some in zip(parts, rows, strict=True):
        end = start + len(some)
        # With another mode, take makes a copy first.
        np.take(part, some, axis=0, out=joined[start:end], mode="clip")
        start = end
    return joined


def hold_out(
    groups: npt.NDArray[np.str_], name: SplitName, fraction: float, seed: int
) -> BoolArray:
    """Choose the test patches.

    Parameters
    ----------
    groups
        Shape `(n,)`: the group of each patch, the patches of a group in numeric order.
    name
        `random`: any patches, as in the original system. `tail`: the last ones of each group, so
        that consecutive video frames are on the same side, except where the two parts meet.
    fraction
        Share of patches to hold out, 0 to 1; at least one patch and never all of a part.

    Returns
    -------
    bool `(n,)`: True for the patches of the test.
    """
    held = np.zeros(len(groups), bool)
    if name == "random":
        order = np.random.default_rng(seed).permutation(len(groups))
        held[order[: _count(len(groups), fraction)]] = True
    else:
        for group in np.unique(groups):
            (rows,) = np.nonzero(groups == group)
            held[rows[len(rows) - _count(len(rows), fraction) :]] = True
    return held


def _count(total: int, fraction: float) -> int:
    return min(max(1, round(total * fraction)), total - 1)
