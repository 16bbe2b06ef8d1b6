"""Which spans of a video to check: a random sample, stratified by traffic.

A video is divided into spans of equal length, of about a minute. They are grouped into strata of
similar traffic, and drawn without replacement in each.
"""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from math import ceil

import numpy as np

from vdet.boxes import Int64Array
from vdet.traffic.clock import Span

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
