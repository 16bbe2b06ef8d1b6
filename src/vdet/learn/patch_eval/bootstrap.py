"""How far a measure may be off by the choice of the test patches.

Source: Efron and Tibshirani, "An Introduction to the Bootstrap", 1993, the percentile interval.
Patches are drawn one by one; where near-duplicates stand in the test the true interval is wider.
"""

from dataclasses import dataclass

import numpy as np

from vdet.geometry import Float64Array
from vdet.learn.patch_eval.measures import MEASURES, Flags, measure

RESAMPLES = 1000
"""Draws of the bootstrap."""

SEED = 0
"""Of the draws, so that two runs agree."""

_PERCENTILES = (2.5, 97.5)
_AT_ONCE = 20  # draws; more would only need more memory


@dataclass(frozen=True, slots=True)
class Interval:
    """The 95 % interval of a measure."""

    low: float
    high: float


def intervals(vehicle: Flags, probabilities: Float64Array) -> dict[str, Interval]:
    """Return the 95 % interval of every measure that has a value in some draw.

    Parameters
    ----------
    vehicle, probabilities
        As `measure` takes them, n > 0.
    """
    random = np.random.default_rng(SEED)
    draws = [
        measure(vehicle, probabilities, _counts(random, len(vehicle)))
        for _ in range(RESAMPLES // _AT_ONCE)
    ]
    found: dict[str, Interval] = {}
    for name in MEASURES:
        values = np.concatenate([draw[name] for draw in draws])
        values = values[~np.isnan(values)]
        if len(values):
            low, high = np.percentile(values, _PERCENTILES)
            found[name] = Interval(float(low), float(high))
    return found


def _counts(random: np.random.Generator, patches: int) -> Float64Array:
    """Return how often each patch is drawn in each of some resamples, float64 `(k, patches)`."""
    drawn = random.integers(patches, size=(_AT_ONCE, patches))
    return np.stack([np.bincount(row, minlength=patches) for row in drawn]).astype(np.float64)
