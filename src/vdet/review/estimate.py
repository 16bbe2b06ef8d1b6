"""How right a count is: the true count, estimated by the spans that were checked.

The page of a review computes the same in `estimate.js`, which explains the method and its sources.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, hypot, inf, sqrt

import numpy as np

from vdet.boxes import Int64Array
from vdet.traffic.clock import Span
from vdet.traffic.counts import ALL, Estimate, VehicleGroup

MIN_CHECKED = 3
"""Minimum number of drawn spans that an interval needs."""
PRECISION = 0.02
"""Half of the width of an interval that is precise enough, as a fraction of the true count."""
_Z = 1.959964
"""Quantile of the normal distribution for 95 %, two-sided."""
_ADDED = 0.6
"""Errors added for the upper limit. With 1 (Garwood) it is too high: it holds 97.5 % at least. With
0.6, no error is seen in at most 6.5 % of the samples where the limit for none is too low."""
_HIDDEN = 0.1
"""Part of the vehicles of a span that may be missed together in one that was not checked: it widens
the upper limit, so that it holds where errors come in bursts.
"""
STRATA = 4
"""Number of strata."""
_SPAN = 60.0
"""Approximate length of a span, seconds."""
_REST = 0.01
"""Part of a span that the last one may be longer."""


def span_length(seconds: float) -> float:
    """Return the length of the spans of a video, of which there is at least one."""
    return round(seconds / max(1, round(seconds / _SPAN)), 6) or _SPAN


class EqualSpans:
    """The spans of a part of a video that have frames; `numbers` are theirs, from 0.

    `video` are the parts with frames, seconds.
    """

    def __init__(self, start: float, end: float, length: float, video: Iterable[Span]) -> None:
        self._count = max(1, ceil((end - start) / length - _REST))
        self._starts = [round(start + number * length, 3) for number in range(self._count)]
        self._end = end
        every = ((self._number(first), self._number(last)) for first, last in video)
        self.numbers = sorted({n for first, last in every for n in range(first, last + 1)})

    def __len__(self) -> int:
        return len(self.numbers)

    def index(self, time: float) -> int:
        """Return the index of the span of a time, or of the nearest one."""
        number = self._number(time)
        return max(0, bisect_right(self.numbers, number) - 1)

    def bounds(self, index: int) -> Span:
        """Return the start of a span and its end, which is not part of it."""
        number = self.numbers[index]
        is_last = number + 1 == self._count
        return self._starts[number], self._end if is_last else self._starts[number + 1]

    def _number(self, time: float) -> int:
        return max(0, bisect_right(self._starts, time) - 1)


def strata_of(traffic: Sequence[int] | Int64Array) -> Int64Array:
    """Return the stratum of each span, from 0 with the least traffic: (spans,) int64.

    Strata have about equal sums of the square root of the traffic, as the errors scatter (Cochran,
    5A.7); equal numbers share one. `traffic` is the number of vehicles counted in each span.
    """
    weights = np.sqrt(np.asarray(traffic, np.float64) + 1)
    order = np.argsort(traffic, kind="stable")
    middle = np.cumsum(weights[order]) - weights[order] / 2
    first = np.searchsorted(np.asarray(traffic)[order], traffic)  # of equal numbers
    strata: Int64Array = (STRATA * middle / weights.sum()).astype(np.int64)[first]
    return strata


def draw_spans(traffic: Sequence[int], seed: int) -> list[int]:
    """Return all spans in the order in which to check them.

    The first n are a random sample of n spans, stratified by traffic, so a longer sample includes a
    shorter one. Each stratum has a part of them by the sum of the square root of its traffic.

    Parameters
    ----------
    traffic
        Number of vehicles counted in each span.
    seed
        Number that selects one of the possible samples, 0 or more.
    """
    strata, turns = strata_of(traffic), np.empty(len(traffic))
    weights, random = np.sqrt(np.asarray(traffic) + 1.0), np.random.Generator(np.random.PCG64(seed))
    for stratum in np.unique(strata):
        members = strata == stratum
        ranks = random.permutation(np.count_nonzero(members)) + 0.5
        turns[members] = ranks / weights[members].sum()
    return [int(span) for span in np.argsort(turns, kind="stable")]


@dataclass(frozen=True, slots=True)
class CountError:
    """An error that a person found: a vehicle that is missed, counted wrongly or named wrongly.

    Attributes
    ----------
    span
        Index of the span.
    counted
        The groups in which it was counted; none if it was missed.
    true
        The groups in which it is right; none if no vehicle passed.
    """

    span: int
    counted: Collection[VehicleGroup]
    true: Collection[VehicleGroup]


def estimate(
    counted: Mapping[VehicleGroup, Sequence[int]],
    errors: Sequence[CountError],
    checked: Collection[int],
    drawn: Collection[int],
) -> list[Estimate]:
    """Estimate the true number of vehicles in each group.

    Parameters
    ----------
    counted
        Number of vehicles of each group counted in each span of the video, also of `ALL`.
    errors
        All known errors; the estimate uses those in checked spans.
    checked
        Spans that were checked. Those that were not drawn count as they are, and say nothing about
        the others.
    drawn
        The spans drawn by `draw_spans`.

    Returns
    -------
    An estimate for each group; empty if spans are left and fewer than `MIN_CHECKED` drawn ones are
    checked.
    """
    traffic = np.asarray(counted[ALL], np.int64)
    sample = np.array(sorted({*checked} & {*drawn}), np.int64)
    unchecked = np.array(sorted({*range(len(traffic))} - {*checked}), np.int64)
    if len(unchecked) and len(sample) < MIN_CHECKED:
        return []
    survey = _CheckedSample(traffic, errors, sample, unchecked)
    groups = dict.fromkeys((*counted, *(group for error in errors for group in error.true)))
    none = np.zeros_like(traffic)
    return [survey.estimate(name, np.asarray(counted.get(name, none))) for name in groups]


@dataclass(frozen=True, slots=True)
class _Unchecked:
    """The errors of one kind in unchecked spans.

    Attributes
    ----------
    number
        Its estimate.
    single, scatter
        Its variance if errors come independently, and by the scatter between spans.
    hidden
        The variance of errors that come together, of which the sample need not have any.
    weight
        Number of unchecked errors that one in the sample stands for.
    limit
        Its maximum.
    """

    number: float
    single: float
    scatter: float
    hidden: float
    weight: float
    limit: float

    def bounds(self, spans: int, unchecked: float, spread: float) -> tuple[float, float]:
        """Return its interval, for a sample of `spans`.

        The number of errors is multiplied by `unchecked`, variances and `weight` by `spread`.
        """
        number, weight = self.number * unchecked, self.weight * spread
        single, scatter, hidden = (
            variance * spread for variance in (self.single, self.scatter, self.hidden)
        )
        added = _ADDED * weight
        high = _gamma(number + added, single + added * (weight + 1) + hidden, _Z)
        if not number:
            return 0.0, min(high, self.limit)
        student = _student(spans - 1)
        low = min(_gamma(number, single, -_Z), _gamma(number, scatter, -student))
        return max(low, 0.0), min(max(high, _gamma(number, scatter + hidden, student)), self.limit)


@dataclass(frozen=True, slots=True)
class _CheckedSample:
    """Counted spans (traffic, (spans,) int64), with the errors found in a sample of them."""

    traffic: Int64Array
    errors: Sequence[CountError]
    sample: Int64Array
    unchecked: Int64Array

    def estimate(self, group: VehicleGroup, numbers: Int64Array) -> Estimate:
        """Return the estimate of a group; `numbers` are its vehicles in each span."""
        counted = int(numbers.sum())
        added, removed = np.zeros_like(numbers), np.zeros_like(numbers)
        for error in self.errors:
            added[error.span] += group in error.true and group not in error.counted
            removed[error.span] += group in error.counted and group not in error.true
        corrected = counted + int(added.sum() - removed.sum())
        added[self.unchecked] = removed[self.unchecked] = 0
        known = counted + int(added.sum() - removed.sum())
        if not len(self.unchecked):
            return Estimate(group, counted, corrected, known, known, known, 0)
        unseen = _HIDDEN * float(numbers.mean())
        gains = self._expected(added, self.traffic + 1, inf, unseen)  # empty spans have errors too
        losses = self._expected(removed, numbers, float(numbers[self.unchecked].sum()), 0.0)
        true = known + gains.number - losses.number
        below, above = self._widths(gains, losses, 0)
        widths = [-sum(self._widths(gains, losses, more)) for more in range(len(self.unchecked))]
        more = bisect_left(widths, -2 * PRECISION * true)
        return Estimate(group, counted, corrected, true, true - below, true + above, more)

    def _expected(
        self, errors: Int64Array, size: Int64Array, limit: float, unseen: float
    ) -> _Unchecked:
        """Estimate errors from those in each span, which are in proportion to `size`.

        In a span that is not checked, `unseen` errors may come together.
        """
        strata = strata_of(self.traffic)
        numbers = np.bincount(strata[self.sample], minlength=STRATA)
        members = np.bincount(strata[self.unchecked], minlength=STRATA) + numbers
        weights = members[strata[self.sample]] / numbers[strata[self.sample]]
        errors, sizes = errors[self.sample], size[self.sample]
        unchecked_size = float(size[self.unchecked].sum())
        weighted = float((weights * sizes).sum())
        if not weighted:  # nothing is known
            return _Unchecked(0.0, 0.0, 0.0, 0.0, limit, limit)
        weights *= unchecked_size / weighted
        number, variances = float((weights * errors).sum()), weights * (weights + 1)
        rate = number / unchecked_size if unchecked_size else 0.0
        scatter = variances * (errors - rate * sizes) ** 2
        weight = unchecked_size / float(sizes.sum())
        return _Unchecked(
            number=number,
            single=float((variances * errors).sum()) * max(0.0, 1 - number / (limit or 1)),
            scatter=float(scatter.sum()) * len(sizes) / (len(sizes) - 1),
            hidden=weight * (weight + 1) * unseen**2,
            weight=weight,
            limit=limit,
        )

    def _widths(self, gains: _Unchecked, losses: _Unchecked, more: int) -> tuple[float, float]:
        """Return the parts of the interval below and above the estimate after `more` spans."""
        spans, unchecked = len(self.sample) + more, 1 - more / len(self.unchecked)
        spread = unchecked * len(self.sample) / spans
        low, high = gains.bounds(spans, unchecked, spread)
        least, most = losses.bounds(spans, unchecked, spread)
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
