"""Where a vehicle was in the latest frames, seen from both sides in time.

The filter knows only what came before a frame. What came after it corrects the estimate.
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
"""Seconds before the first detection in which a vehicle is shown that comes into the frame."""

_ENTERING = 0.1
"""Minimum speed of a vehicle that comes into the frame, in its sizes a second."""


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
    """

    time: float
    state: MotionState
    score: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Where a vehicle is at a time.

    `mean` is centre x and y and log width and height, `(4,)`. `bridges` says that a search between
    the detections before and after this time missed the vehicle.
    """

    mean: Float64Array
    state: State
    bridges: bool = False


class History:
    """The latest moments of a vehicle.

    Attributes
    ----------
    moments
        By time; at least one of them has a detection.
    """

    def __init__(self, first: Moment) -> None:
        self.moments = [first]
        self._smoothed: list[Float64Array] | None = None

    @property
    def last_seen(self) -> Moment:
        """The latest moment with a detection."""
        return next(moment for moment in reversed(self.moments) if moment.score is not None)

    def add(self, moment: Moment) -> None:
        """Add the next moment."""
        self.moments.append(moment)
        self._smoothed = None

    def forget(self, before: float) -> None:
        """Drop the moments that say nothing of times after `before`, but keep a detection."""
        moments, last = self.moments, self.last_seen
        while len(moments) > 1 and moments[1].time <= before and moments[0] is not last:
            del moments[0]
            self._smoothed = None

    def join(self, earlier: "History") -> None:
        """Put the moments of the same vehicle's earlier track before its own."""
        begin = self.moments[0].time
        self.moments[:0] = [moment for moment in earlier.moments if moment.time < begin]
        self._smoothed = None

    def scores(self, time: float) -> tuple[float, float]:
        """Return the mean score of the detections around a time, and with 0 for each miss."""
        until = max(self.last_seen.time, time)
        kept = [
            (math.exp(-abs(moment.time - time) / SCORE_TIME), moment.score)
            for moment in self.moments
            if moment.time <= until
        ]
        total = sum(weight * score for weight, score in kept if score is not None)
        seen = sum(weight for weight, score in kept if score is not None)
        return total / seen, total / sum(weight for weight, _ in kept)

    def at(self, time: float, longest_gap: float) -> Place | None:
        """Return where the vehicle is at a time up to the latest moment; None if not known.

        Parameters
        ----------
        longest_gap
            Seconds between two detections over which misses are bridged.
        """
        moments = self.moments
        seen = [number for number, moment in enumerate(moments) if moment.score is not None]
        split = bisect_right(seen, time, key=lambda number: moments[number].time)
        if split and moments[seen[split - 1]].time == time:
            return Place(self.means()[seen[split - 1]][:, 0], "detected")
        if split == len(seen):
            return None
        if not split:
            return self._entering(seen[0], time)
        before, after = seen[split - 1 : split + 1]
        bridges = after - before > 1
        if bridges and moments[after].time - moments[before].time > longest_gap:
            return None
        return Place(self._between(time, before, after), "interpolated", bridges)

    def _between(self, time: float, before: int, after: int) -> Float64Array:
        """Return the mean at a time between the moments of two consecutive detections."""
        moments, means = self.moments, self.means()
        if all(moment.state.gain is not None for moment in moments[before + 1 : after + 1]):
            # The misses between are of the same track.
            after = bisect_right(moments, time, key=lambda moment: moment.time)
            before = after - 1
        share = (time - moments[before].time) / (moments[after].time - moments[before].time)
        return np.asarray(means[before][:, 0] * (1 - share) + means[after][:, 0] * share)

    def _entering(self, first: int, time: float) -> Place | None:
        """Return where the vehicle was before its first detection, if it came into the frame."""
        moment, mean = self.moments[first], self.means()[first]
        ways_in = moment.state.ways_in
        axis = 0 if ways_in[0] else 1
        speed = mean[axis, 1] * ways_in[axis]
        if moment.time - time > _ENTRY or speed < _ENTERING * math.exp(mean[axis + 2, 0]):
            return None
        # Its size hardly shows where it is cut off.
        return Place(carried(mean, time - moment.time), "interpolated")

    def means(self) -> list[Float64Array]:
        """Return the smoothed means of all moments, each `(4, 2)`."""
        if self._smoothed is None:
            means = [moment.state.mean for moment in self.moments]
            for number in range(len(means) - 1, 0, -1):
                state = self.moments[number].state
                if state.expected is not None and state.gain is not None:
                    change = (means[number] - state.expected)[:, :, np.newaxis]
                    means[number - 1] = means[number - 1] + (state.gain @ change)[:, :, 0]
            self._smoothed = means
        return self._smoothed


def carried(mean: Float64Array, seconds: float) -> Float64Array:
    """Return centre and log size, `(4,)`, if so long the velocity of `mean` and the size stay."""
    place = mean[:, 0].copy()
    place[:2] += mean[:2, 1] * seconds
    return place
