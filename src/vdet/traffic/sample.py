"""Which minutes of a video to check: a random sample, stratified by traffic.

Minutes are grouped into strata of similar traffic, and drawn without replacement in each.
"""

from collections.abc import Sequence

import numpy as np

from vdet.boxes import Int64Array

STRATA = 4
"""Number of strata."""


def strata_of(traffic: Sequence[int] | Int64Array) -> Int64Array:
    """Return the stratum of each minute, from 0 with the least traffic: (minutes,) int64.

    Strata have about equal sums of the square root of the traffic, as the errors scatter (Cochran,
    5A.7); equal numbers share one. `traffic` is the number of vehicles counted in each minute.
    """
    weights = np.sqrt(np.asarray(traffic, np.float64) + 1)
    order = np.argsort(traffic, kind="stable")
    middle = np.cumsum(weights[order]) - weights[order] / 2
    first = np.searchsorted(np.asarray(traffic)[order], traffic)  # of equal numbers
    strata: Int64Array = (STRATA * middle / weights.sum()).astype(np.int64)[first]
    return strata


def draw_minutes(traffic: Sequence[int], seed: int) -> list[int]:
    """Return all minutes in the order in which to check them.

    The first n are a random sample of n minutes, stratified by traffic, so a longer sample includes
    a shorter one. Each stratum has a part of them by the sum of the square root of its traffic.

    Parameters
    ----------
    traffic
        Number of vehicles counted in each minute.
    seed
        Number that selects one of the possible samples, 0 or more.
    """
    strata, turns = strata_of(traffic), np.empty(len(traffic))
    weights, random = np.sqrt(np.asarray(traffic) + 1.0), np.random.Generator(np.random.PCG64(seed))
    for stratum in np.unique(strata):
        members = strata == stratum
        ranks = random.permutation(np.count_nonzero(members)) + 0.5
        turns[members] = ranks / weights[members].sum()
    return [int(minute) for minute in np.argsort(turns, kind="stable")]
