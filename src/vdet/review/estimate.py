"""How right a count is: the true count, estimated by the spans that were checked.

The page of a review computes the same in `estimate.js`, which explains the method and its sources.
"""

from bisect import bisect_left
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
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
_HIDDEN = 0.15
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


def equal_spans(start: float, end: float, length: float, video: Iterable[Span]) -> dict[int, Span]:
    """Return the spans of a part of a video that have frames, by their numbers from 0.

    `video` are the parts with frames. All are seconds; the end of a span is not part of it.
    """
    count = max(1, ceil((end - start) / length - _REST))
    edges = [*(round(start + number * length, 3) for number in range(count)), end]
    parts = list(video)
    spans = {
        number: (first, last)
        for number, (first, last) in enumerate(pairwise(edges))
        if any(begin < last and first <= until for begin, until in parts)
    }
    return spans or {0: (start, end)}


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


def draw_spans(traffic: Sequence[int] | Int64Array, seed: int) -> list[int]:
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


def estimate(
    numbers: Mapping[VehicleGroup, Int64Array], checked: Collection[int], drawn: Collection[int]
) -> list[Estimate]:
    """Estimate the true number of vehicles in each group, also of `ALL`.

    Parameters
    ----------
    numbers
        Of each group: vehicles counted in each span of the video, and of all known errors, those
        missed in this group, and those counted wrongly in it; (3, spans) int64. The estimate uses
        errors in checked spans.
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
    traffic = numbers[ALL][0]
    sample = np.array(sorted({*checked} & {*drawn}), np.int64)
    unchecked = np.array(sorted({*range(len(traffic))} - {*checked}), np.int64)
    if len(unchecked) and len(sample) < MIN_CHECKED:
        return []
    survey = _CheckedSample(traffic, sample, unchecked)
    return [survey.estimate(group, of_group) for group, of_group in numbers.items()]


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
        student = _student(spans - 1)
        high = max(
            _gamma(number + added, single + added * (weight + 1) + hidden, _Z),
            number + student * sqrt(hidden),  # of few spans the gamma distribution says too little
        )
        if not number:
            return 0.0, min(high, self.limit)
        low = min(_gamma(number, single, -_Z), _gamma(number, scatter, -student))
        return max(low, 0.0), min(max(high, _gamma(number, scatter + hidden, student)), self.limit)


@dataclass(frozen=True, slots=True)
class _CheckedSample:
    """A sample of spans, by their indices; `traffic` is what was counted, (spans,) int64."""

    traffic: Int64Array
    sample: Int64Array
    unchecked: Int64Array

    def estimate(self, group: VehicleGroup, numbers: Int64Array) -> Estimate:
        """Return the estimate of a group; `numbers` as for the function `estimate`."""
        counted, missed, false = map(int, numbers.sum(axis=1))
        corrected = counted + missed - false
        _, missed_elsewhere, false_elsewhere = map(int, numbers[:, self.unchecked].sum(axis=1))
        known = corrected - missed_elsewhere + false_elsewhere
        if not len(self.unchecked):
            return Estimate(group, counted, corrected, known, known, known, 0)
        each, added, removed = numbers
        unseen, left = _HIDDEN * float(each.mean()), float(each[self.unchecked].sum())
        gains = self._expected(added, self.traffic + 1, inf, unseen)  # empty spans have errors too
        losses = self._expected(removed, each, left, 0.0)
        true = known + gains.number - losses.number
        below, above = self._widths(gains, losses, 0)
        more = bisect_left(
            range(len(self.unchecked)),
            -2 * PRECISION * true,
            key=lambda more: -sum(self._widths(gains, losses, more)),
        )
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
