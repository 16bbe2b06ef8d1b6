"""Where a vehicle was in the latest frames, seen from both sides in time.

The filter knows only what came before a frame. What came after it corrects the estimate.
Source: Rauch, Tung and Striebel, "Maximum Likelihood Estimates of Linear Dynamic Systems", 1965.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float64Array
from vdet.track.motion.state import MotionState, whole_box
from vdet.track.track import State

SCORE_TIME = 0.5
"""Seconds over which the scores of detections are averaged."""

_ENTRY = 0.4
"""Seconds before the first detection in which a vehicle is shown that comes into the frame."""

_ENTERING = 0.1
"""Least speed of a vehicle that comes into the frame, in its sizes a second."""


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A vehicle in a frame that was searched.

    Attributes
    ----------
    time
        Of the frame, seconds.
    state
        After the frame.
    score
        Of its detection; None where it was not detected.
    expected
        Mean before its detection, as in `MotionState`; None in the first frame.
    gain
        How the moment before follows from this one, `(4, 2, 2)`; None in the first frame.
    entering
        Axis on which the frame's side cuts the detection off, and the direction into the frame, 1
        or -1; None where no side, or both, do.
    """

    time: float
    state: MotionState
    score: float | None
    expected: Float64Array | None = None
    gain: Float64Array | None = None
    entering: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Where a vehicle is at a time.

    `mean` is centre x and y and log width and height, `(4,)`. `bridges` says that a search between
    the detections before and after this time missed the vehicle.
    """

    mean: Float64Array
    state: State
    bridges: bool = False

    @property
    def box(self) -> Float64Array:
        """x1, y1, x2, y2 in pixels, `(4,)`, with what lies outside the frame."""
        return whole_box(self.mean)


class History:
    """The latest moments of a vehicle, by time; at least one of them has a detection."""

    def __init__(self, moments: Sequence[Moment]) -> None:
        self._moments = list(moments)
        self._smoothed: list[Float64Array] | None = None

    @property
    def begin(self) -> float:
        """Time of the earliest moment that is remembered."""
        return self._moments[0].time

    @property
    def first(self) -> Float64Array:
        """Where the vehicle was then: smoothed centre x and y and log width and height, `(4,)`."""
        return self._means()[0][:, 0]

    @property
    def last_seen(self) -> float:
        """Time of the latest detection."""
        return self._last_detected.time

    @property
    def last_velocity(self) -> Float64Array:
        """Velocity at the latest detection, x and y in sizes of the vehicle a second."""
        mean = self._last_detected.state.mean
        return np.asarray(mean[:2, 1] / np.exp(mean[2:, 0]))

    def expected(self, time: float) -> Float64Array:
        """Return where the vehicle should be at a time after its latest detection; as `first`."""
        last = self._last_detected
        place = last.state.mean[:, 0].copy()
        place[:2] += last.state.mean[:2, 1] * max(time - last.time, 0.0)
        return place

    @property
    def _last_detected(self) -> Moment:
        return next(each for each in reversed(self._moments) if each.score is not None)

    @property
    def latest(self) -> float:
        """Time of the latest moment."""
        return self._moments[-1].time

    def add(self, moment: Moment) -> None:
        """Add the next moment."""
        self._moments.append(moment)
        self._smoothed = None

    def forget(self, before: float) -> None:
        """Drop the moments that say nothing of times after `before`."""
        while len(self._moments) > 1 and self._moments[1].time <= before:
            if self._moments[0].time >= self.last_seen:
                return
            del self._moments[0]
            if self._smoothed:
                del self._smoothed[0]

    def join(self, earlier: "History") -> None:
        """Put the moments of the same vehicle's earlier track before its own."""
        begin = self._moments[0].time
        before = [each for each in earlier._moments if each.time < begin]
        self._moments = before + [each for each in self._moments if each.time >= begin]
        self._smoothed = None

    def scores(self, time: float) -> tuple[float, float]:
        """Return the mean score of the detections around a time, and with 0 for each miss."""
        last = self.last_seen
        kept = [each for each in self._moments if each.time <= max(last, time)]
        weights = [math.exp(-abs(each.time - time) / SCORE_TIME) for each in kept]
        total = sum(w * (each.score or 0.0) for w, each in zip(weights, kept, strict=True))
        seen = sum(w for w, each in zip(weights, kept, strict=True) if each.score is not None)
        return total / seen, total / sum(weights)

    def at(self, time: float, longest_gap: float) -> Place | None:
        """Return where the vehicle is at a time up to the latest moment; None if not known.

        Parameters
        ----------
        longest_gap
            Seconds between two detections over which misses are bridged.
        """
        moments = self._moments
        last = bisect_right(moments, time, key=lambda each: each.time) - 1  # at or before `time`
        before = next((n for n in range(last, -1, -1) if moments[n].score is not None), None)
        if before is not None and moments[before].time == time:
            return Place(self._means()[before][:, 0], "seen")
        after = next(
            (n for n in range(last + 1, len(moments)) if moments[n].score is not None), None
        )
        if after is None:
            return None
        if before is None:
            return self._entering(after, time)
        bridges = after - before > 1
        if bridges and moments[after].time - moments[before].time > longest_gap:
            return None
        return Place(self._between(time, before, last, after), "between", bridges)

    def _between(self, time: float, before: int, last: int, after: int) -> Float64Array:
        """Return the mean at a time between the moments `last` and the next one."""
        moments, means = self._moments, self._means()
        joined = any(each.gain is None for each in moments[before + 1 : after + 1])
        first, second = (before, after) if joined else (last, last + 1)
        share = (time - moments[first].time) / (moments[second].time - moments[first].time)
        return np.asarray(means[first][:, 0] * (1 - share) + means[second][:, 0] * share)

    def _entering(self, first: int, time: float) -> Place | None:
        """Return where the vehicle was before its first detection, if it came into the frame."""
        moment, mean = self._moments[first], self._means()[first]
        if moment.entering is None or moment.time - time > _ENTRY:
            return None
        axis, inward = moment.entering
        if mean[axis, 1] * inward < _ENTERING * math.exp(mean[axis + 2, 0]):
            return None
        moved = mean[:, 0].copy()
        moved[:2] += mean[:2, 1] * (time - moment.time)  # its size hardly shows where it is cut off
        return Place(moved, "between")

    def _means(self) -> list[Float64Array]:
        """Return the smoothed means of all moments, each `(4, 2)`."""
        if self._smoothed is None:
            means = [each.state.mean for each in self._moments]
            for number in range(len(means) - 1, 0, -1):
                later = self._moments[number]
                if later.expected is not None and later.gain is not None:
                    change = (means[number] - later.expected)[:, :, np.newaxis]
                    means[number - 1] = means[number - 1] + (later.gain @ change)[:, :, 0]
            self._smoothed = means
        return self._smoothed
