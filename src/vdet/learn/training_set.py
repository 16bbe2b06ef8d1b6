"""Which patches are learned from, with their augmented samples, and which are held out."""

from typing import Literal

import numpy as np
import numpy.typing as npt

from vdet.geometry import BoolArray
from vdet.learn.extraction import LabelledVectors, SampleVectors

SplitName = Literal["random", "tail"]


def training_set(data: LabelledVectors, kept: BoolArray) -> SampleVectors:
    """Return the kept patches, bool `(n,)`, followed by the samples made of these."""
    sides = np.full((len(kept), 4), np.nan, np.float32) if data.sides is None else data.sides
    rows = np.cumsum(kept) - 1  # in the training set
    patches = SampleVectors(data.vectors[kept], data.vehicle[kept], sides[kept], rows[kept])
    if data.augmented is None:
        return patches
    made = data.augmented
    used = kept[made.origins]
    augmented = SampleVectors(
        made.vectors[used], made.vehicle[used], made.sides[used], rows[made.origins[used]]
    )
    return SampleVectors.joined([patches, augmented])


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
