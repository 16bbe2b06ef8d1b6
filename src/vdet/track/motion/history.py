"""The latest estimates of a vehicle, corrected by later frames.

The filter (`state`) uses only earlier frames. Later frames then correct its estimates.
Source: Rauch, Tung and Striebel, "Maximum Likelihood Estimates of Linear Dynamic Systems", 1965.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float64Array
from vdet.track.motion.state import MotionState
from vdet.track.track import State

SCORE_TIME = 0.5
"""Seconds over which the scores of detections are averaged."""

_ENTRY = 0.4
"""Seconds before its first detection during which an entering vehicle is shown."""

_ENTERING = 0.1
"""Minimum speed of a vehicle that enters the frame, in its sizes per second."""


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """A vehicle after a searched frame.

    Attributes
    ----------
    time
        Time of the frame, seconds.
    state
        Its motion after the frame.
    score
        Score of its detection; None if it was not detected.
    """

    time: float
    state: MotionState
    score: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Position:
    """The position of a vehicle at a time.

    `mean` is centre x and y and log width and height, `(4,)`. `bridges` says that a search between
    the detections before and after this time missed the vehicle.
    """

    mean: Float64Array
    state: State
    bridges: bool = False


class History:
    """The latest estimates of a vehicle.

    Attributes
    ----------
    estimates
        In order of time; at least one has a detection.
    """

    def __init__(self, first: Estimate) -> None:
        self.estimates = [first]
        self._smoothed: list[Float64Array] | None = None

    @property
    def last_seen(self) -> Estimate:
        """The latest estimate with a detection."""
        return next(estimate for estimate in reversed(self.estimates) if estimate.score is not None)

    def add(self, estimate: Estimate) -> None:
        """Add the next estimate."""
        self.estimates.append(estimate)
        self._smoothed = None

    def forget(self, before: float) -> None:
        """Drop estimates that do not affect times after `before`, but keep a detection."""
        last = self.last_seen
        while self.estimates[0] is not last and self.estimates[1].time <= before:
            del self.estimates[0]
            self._smoothed = None

    def join(self, earlier: "History") -> None:
        """Prepend the estimates of an earlier track of the same vehicle."""
        begin = self.estimates[0].time
        self.estimates[:0] = [estimate for estimate in earlier.estimates if estimate.time < begin]
        self._smoothed = None

    def scores(self, time: float) -> tuple[float, float]:
        """Return the mean score of the detections around a time, without and with misses as 0."""
        until = max(self.last_seen.time, time)
        weighted = [
            (math.exp(-abs(estimate.time - time) / SCORE_TIME), estimate.score)
            for estimate in self.estimates
            if estimate.time <= until
        ]
        total = sum(weight * score for weight, score in weighted if score is not None)
        seen = sum(weight for weight, score in weighted if score is not None)
        return total / seen, total / sum(weight for weight, _ in weighted)

    def at(self, time: float, longest_gap: float) -> Position | None:
        """Return the position at a time up to the latest estimate; None if unknown.

        Parameters
        ----------
        longest_gap
            Maximum seconds between two detections to bridge misses.
        """
        estimates = self.estimates
        seen = [number for number, estimate in enumerate(estimates) if estimate.score is not None]
        split = bisect_right(seen, time, key=lambda number: estimates[number].time)
        if split and estimates[seen[split - 1]].time == time:
            return Position(self.means()[seen[split - 1]][:, 0], "detected")
        if split == len(seen):
            return None
        if not split:
            return self._entering(seen[0], time)
        before, after = seen[split - 1 : split + 1]
        bridges = after - before > 1
        if bridges and estimates[after].time - estimates[before].time > longest_gap:
            return None
        return Position(self._between(time, before, after), "interpolated", bridges)

    def _between(self, time: float, before: int, after: int) -> Float64Array:
        """Return the mean at a time between the estimates of two consecutive detections."""
        estimates, means = self.estimates, self.means()
        if all(estimate.state.gain is not None for estimate in estimates[before + 1 : after + 1]):
            # The misses in between belong to the same track.
            after = bisect_right(estimates, time, key=lambda estimate: estimate.time)
            before = after - 1
        start, end = estimates[before].time, estimates[after].time
        fraction = (time - start) / (end - start)
        return np.asarray(means[before][:, 0] * (1 - fraction) + means[after][:, 0] * fraction)

    def _entering(self, first: int, time: float) -> Position | None:
        """Return the position before the first detection, if the vehicle entered the frame then."""
        estimate, mean = self.estimates[first], self.means()[first]
        ways_in = estimate.state.ways_in
        axis = 0 if ways_in[0] else 1
        speed = mean[axis, 1] * ways_in[axis]
        if estimate.time - time > _ENTRY or speed < _ENTERING * math.exp(mean[axis + 2, 0]):
            return None
        # Its size is uncertain while it is cut off.
        return Position(carried(mean, time - estimate.time), "interpolated")

    def means(self) -> list[Float64Array]:
        """Return the smoothed means of all estimates, each `(4, 2)`."""
        if self._smoothed is None:
            means = [estimate.state.mean for estimate in self.estimates]
            for number in range(len(means) - 1, 0, -1):
                state = self.estimates[number].state
                if state.expected is not None and state.gain is not None:
                    change = (means[number] - state.expected)[:, :, np.newaxis]
                    means[number - 1] = means[number - 1] + (state.gain @ change)[:, :, 0]
            self._smoothed = means
        return self._smoothed


def carried(mean: Float64Array, seconds: float) -> Float64Array:
    """Return centre and log size, `(4,)`, after `seconds` at constant velocity and size."""
    position = mean[:, 0].copy()
    position[:2] += mean[:2, 1] * seconds
    return position
