"""How right a count is: the true count, estimated by the minutes that were checked.

The page of a review computes the same in `estimate.js`, which explains the method and its sources.
"""

from bisect import bisect_left
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import hypot, inf, sqrt

import numpy as np

from vdet.boxes import Int64Array
from vdet.traffic.sample import STRATA, strata_of

MIN_CHECKED = 3
"""Minimum number of drawn minutes that an interval needs."""
PRECISION = 0.02
"""Half of the width of an interval that is precise enough, as a fraction of the true count."""
_Z = 1.959964
"""Quantile of the normal distribution for 95 %, two-sided."""
_ADDED = 0.6
"""Errors added for the upper limit. With 1 (Garwood) it is too high: it holds 97.5 % at least. With
0.6, no error is seen in at most 6.5 % of the samples where the limit for none is too low."""


@dataclass(frozen=True, slots=True)
class CountError:
    """An error that a person found: a vehicle that is missed, counted wrongly or named wrongly.

    Attributes
    ----------
    minute
        Number of the minute, from 0.
    counted
        Class (or any other group, such as a direction) it was counted as; None if it was missed.
    true
        Class it should be counted as; None if no vehicle passed.
    """

    minute: int
    counted: str | None
    true: str | None


@dataclass(frozen=True, slots=True)
class Estimate:
    """The true number of vehicles of a class.

    Attributes
    ----------
    group
        The class; None for all vehicles.
    counted
        Number that was counted in all minutes.
    true
        Estimate of the true number.
    low, high
        Its interval of 95 %.
    minutes_to_precision
        How many more drawn minutes are expected to bring half of the width of the interval to 2 %
        of the true number; 0 if it is that narrow.
    """

    group: str | None
    counted: int
    true: float
    low: float
    high: float
    minutes_to_precision: int


def estimate(
    counted: Mapping[str, Sequence[int]],
    errors: Sequence[CountError],
    checked: Collection[int],
    drawn: Collection[int],
) -> list[Estimate]:
    """Estimate the true number of all vehicles, then of each class.

    Parameters
    ----------
    counted
        Number of vehicles of each class counted in each minute of the video.
    errors
        The errors in checked minutes.
    checked
        Minutes that were checked. Those that were not drawn count as they are, and say nothing
        about the others.
    drawn
        The minutes drawn by `draw_minutes`.

    Returns
    -------
    An estimate for all vehicles and each class; empty if minutes are left and fewer than
    `MIN_CHECKED` drawn ones are checked.
    """
    traffic = np.sum([list(numbers) for numbers in counted.values()], axis=0)
    sample = np.array(sorted(set(checked) & set(drawn)), np.int64)
    unchecked = np.array(sorted(set(range(len(traffic))) - set(checked)), np.int64)
    if len(unchecked) and len(sample) < MIN_CHECKED:
        return []
    survey = _CheckedSample(traffic, errors, sample, unchecked)
    classes = sorted(set(counted) | {error.true for error in errors if error.true})
    groups = [(name, counted.get(name, np.zeros_like(traffic))) for name in classes]
    return [survey.estimate(name, np.asarray(group)) for name, group in [(None, traffic), *groups]]


@dataclass(frozen=True, slots=True)
class _Unchecked:
    """The errors of one kind in unchecked minutes.

    Attributes
    ----------
    number
        Its estimate.
    single, scatter
        Its variance if errors come independently, and by the scatter between minutes.
    weight
        Number of unchecked errors that one in the sample stands for.
    limit
        Its maximum.
    """

    number: float
    single: float
    scatter: float
    weight: float
    limit: float

    def bounds(self, minutes: int, unchecked: float, spread: float) -> tuple[float, float]:
        """Return its interval, for a sample of `minutes`.

        The number of errors is multiplied by `unchecked`, variances and `weight` by `spread`.
        """
        number, weight = self.number * unchecked, self.weight * spread
        single, scatter = self.single * spread, self.scatter * spread
        added = _ADDED * weight
        high = _gamma(number + added, single + added * (weight + 1), _Z)
        if not number:
            return 0.0, min(high, self.limit)
        student = _student(minutes - 1)
        low = min(_gamma(number, single, -_Z), _gamma(number, scatter, -student))
        return max(low, 0.0), min(max(high, _gamma(number, scatter, student)), self.limit)


@dataclass(frozen=True, slots=True)
class _CheckedSample:
    """Counted minutes (traffic, (minutes,) int64), with the errors found in a sample of them."""

    traffic: Int64Array
    errors: Sequence[CountError]
    sample: Int64Array
    unchecked: Int64Array

    def estimate(self, group: str | None, numbers: Int64Array) -> Estimate:
        """Return the estimate of a class; `numbers` are its vehicles in each minute."""
        counted = int(numbers.sum())
        added, removed = np.zeros_like(numbers), np.zeros_like(numbers)
        for error in self.errors:
            is_true, is_counted = (
                name is not None and group in (None, name) for name in (error.true, error.counted)
            )
            added[error.minute] += is_true and not is_counted
            removed[error.minute] += is_counted and not is_true
        corrected = counted + int(added.sum() - removed.sum())
        if not len(self.unchecked):
            return Estimate(group, counted, corrected, corrected, corrected, 0)
        gains = self._expected(added, self.traffic + 1, inf)  # empty minutes have errors too
        losses = self._expected(removed, numbers, float(numbers[self.unchecked].sum()))
        true = corrected + gains.number - losses.number
        below, above = self._widths(gains, losses, 0)
        widths = [-sum(self._widths(gains, losses, more)) for more in range(len(self.unchecked))]
        more = bisect_left(widths, -2 * PRECISION * true)
        return Estimate(group, counted, true, true - below, true + above, more)

    def _expected(self, errors: Int64Array, size: Int64Array, limit: float) -> _Unchecked:
        """Estimate errors from those in each minute, which are in proportion to `size`."""
        strata = strata_of(self.traffic)
        numbers = np.bincount(strata[self.sample], minlength=STRATA)
        members = np.bincount(strata[self.unchecked], minlength=STRATA) + numbers
        weights = members[strata[self.sample]] / numbers[strata[self.sample]]
        errors, sizes = errors[self.sample], size[self.sample]
        unchecked_size = float(size[self.unchecked].sum())
        weighted = float((weights * sizes).sum())
        if not weighted:  # nothing is known
            return _Unchecked(0.0, 0.0, 0.0, limit, limit)
        weights *= unchecked_size / weighted
        number, variances = float((weights * errors).sum()), weights * (weights + 1)
        rate = number / unchecked_size if unchecked_size else 0.0
        scatter = variances * (errors - rate * sizes) ** 2
        return _Unchecked(
            number=number,
            single=float((variances * errors).sum()) * max(0.0, 1 - number / (limit or 1)),
            scatter=float(scatter.sum()) * len(sizes) / (len(sizes) - 1),
            weight=unchecked_size / float(sizes.sum()),
            limit=limit,
        )

    def _widths(self, gains: _Unchecked, losses: _Unchecked, more: int) -> tuple[float, float]:
        """Return the parts of the interval below and above the estimate after `more` minutes."""
        minutes, unchecked = len(self.sample) + more, 1 - more / len(self.unchecked)
        spread = unchecked * len(self.sample) / minutes
        low, high = gains.bounds(minutes, unchecked, spread)
        least, most = losses.bounds(minutes, unchecked, spread)
        gained, lost = gains.number * unchecked, losses.number * unchecked
        return hypot(gained - low, most - lost), hypot(high - gained, lost - least)


def _gamma(mean: float, variance: float, z: float) -> float:
    """Return a quantile of the gamma distribution; `z` is that of the normal distribution."""
    if not variance:
        return mean
    part = variance / (9 * mean * mean)
    return mean * max(0.0, 1 - part + z * sqrt(part)) ** 3


def _student(freedom: int) -> float:
    """Return the quantile of Student's t for 95 %, two-sided."""
    z, n = _Z, freedom
    second, third = 5 * z**5 + 16 * z**3 + 3 * z, 3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z
    return z + (z**3 + z) / 4 / n + second / 96 / n**2 + third / 384 / n**3
