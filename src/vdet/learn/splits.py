"""Which patches are learnt from, and which are held out for the test."""

from typing import Literal

import numpy as np
import numpy.typing as npt

Held = npt.NDArray[np.bool_]
"""Shape `(n,)`: true for the patches of the test."""

SplitName = Literal["random", "tail"]


def hold_out(groups: npt.NDArray[np.str_], name: SplitName, fraction: float, seed: int) -> Held:
    """Choose the test patches.

    Parameters
    ----------
    groups
        Shape `(n,)`: the group of each patch, patches of a group in numeric order.
    name
        `random`: any (the original's). `tail`: the last of each group; consecutive video frames
        then do not stand on both sides, but for the one place where the two meet.
    fraction
        Share of patches to hold out, 0 to 1; at least one, never all, of a split part.
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
