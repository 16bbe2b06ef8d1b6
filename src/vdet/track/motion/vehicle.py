"""One vehicle: its history, its motion, the evidence for it, and its score.

The filter (`state`) uses only earlier frames. Later frames then correct its estimates.
Source: Rauch, Tung and Striebel, "Maximum Likelihood Estimates of Linear Dynamic Systems", 1965.

The evidence for a vehicle is a running sum that leaks, as in Page, "Continuous Inspection
Schemes", 1954: detections whose score is below the leak never add up, however long they last.
It is measured in seconds of detections with score 1, so that it does not depend on the frame rate.
"""

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from vdet.boxes import Float64Array
from vdet.config.schema import MotionTrackerSettings
from vdet.track.motion.state import MotionState
from vdet.track.track import State
from vdet.track.votes import ClassVotes, vote_weight

SCORE_TIME = 0.5
"""Seconds over which the scores of detections are averaged."""

_ENTRY = 0.4
"""Seconds before its first detection during which an entering vehicle is shown."""

_ENTERING = 0.1
"""Minimum speed of a vehicle that enters the frame, in its sizes per second."""


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A vehicle in a searched frame.

    Attributes
    ----------
    time
        Time of the frame, seconds.
    state
        State after the frame.
    score
        Score of its detection; None if it was not detected.
    """

    time: float
    state: MotionState
    score: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """The place of a vehicle at a time.

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
        In order of time; at least one has a detection.
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
        """Drop moments that do not affect times after `before`, but keep a detection."""
        last = self.last_seen
        while self.moments[0] is not last and self.moments[1].time <= before:
            del self.moments[0]
            self._smoothed = None

    def join(self, earlier: "History") -> None:
        """Prepend the moments of an earlier track of the same vehicle."""
        begin = self.moments[0].time
        self.moments[:0] = [moment for moment in earlier.moments if moment.time < begin]
        self._smoothed = None

    def scores(self, time: float) -> tuple[float, float]:
        """Return the mean score of the detections around a time, without and with misses as 0."""
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
        """Return the place at a time up to the latest moment; None if unknown.

        Parameters
        ----------
        longest_gap
            Maximum seconds between two detections to bridge misses.
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
            # The misses in between belong to the same track.
            after = bisect_right(moments, time, key=lambda moment: moment.time)
            before = after - 1
        fraction = (time - moments[before].time) / (moments[after].time - moments[before].time)
        return np.asarray(means[before][:, 0] * (1 - fraction) + means[after][:, 0] * fraction)

    def _entering(self, first: int, time: float) -> Place | None:
        """Return the place before the first detection, if the vehicle entered the frame then."""
        moment, mean = self.moments[first], self.means()[first]
        ways_in = moment.state.ways_in
        axis = 0 if ways_in[0] else 1
        speed = mean[axis, 1] * ways_in[axis]
        if moment.time - time > _ENTRY or speed < _ENTERING * math.exp(mean[axis + 2, 0]):
            return None
        # Its size is uncertain while it is cut off.
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
    """Return centre and log size, `(4,)`, after `seconds` at constant velocity and size."""
    place = mean[:, 0].copy()
    place[:2] += mean[:2, 1] * seconds
    return place


LONGEST_LOOK = 0.1
"""Maximum seconds that one frame counts as evidence: a single frame must not be enough."""

_LONGEST_DOUBT = 0.6
"""Maximum seconds that detections below the decay keep a vehicle present; at least `coast_seconds`.

In the distance, such weak detections lead from one vehicle to the next.
"""

_SLOWING_TIME = 0.8
"""Seconds in which the velocity of a vehicle unseen for over `coast_seconds` falls to 1/e."""

_SETTLING_TIME = 0.4
"""The same for the change of its size, from the first miss on, because growth adds up quickly."""

_APPEARANCE_TIME = 0.3
"""Seconds over which the appearance of the detections is averaged."""

_NOISE = 0.12
"""Standard deviation of the sides of a detection with score 1, as a fraction of the vehicle's size.
"""

_MIN_SCORE = 0.05
"""Below this score, the noise of a box does not increase further."""


@dataclass(frozen=True, slots=True)
class Look:
    """A searched frame.

    `time` and `seconds` since the previous searched frame are in seconds; `size` is width and
    height in pixels.
    """

    time: float
    seconds: float
    size: tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """A detection inside the frame.

    `box` is x1, y1, x2, y2 in pixels, float64 `(4,)`; `classes` has the probability of each class;
    `appearance` is `(2, 3)`, see `appearances`.
    """

    box: Float64Array
    score: float
    classes: Mapping[str, float] = field(default_factory=dict)
    appearance: Float64Array = field(default_factory=lambda: np.full((2, 3), np.nan))

    @property
    def noise(self) -> float:
        """Standard deviation of the box: its variance grows as the score falls."""
        return float(_NOISE / max(self.score, _MIN_SCORE) ** 0.5)


@dataclass(eq=False, slots=True)
class RecentMean:
    """An exponentially weighted mean of values over the latest `SCORE_TIME`."""

    _sum: float = 0.0
    _weight: float = 0.0

    @property
    def value(self) -> float:
        """The mean so far."""
        return self._sum / self._weight

    def add(self, value: float, seconds: float) -> None:
        """Add the value of the latest `seconds`."""
        kept = math.exp(-seconds / SCORE_TIME)
        self._sum = kept * self._sum + (1 - kept) * value
        self._weight = kept * self._weight + (1 - kept)


class Vehicle:
    """A tracked vehicle.

    Parameters
    ----------
    first, look
        Its first detection, and the frame.

    Attributes
    ----------
    state
        Its motion up to the latest frame.
    evidence
        Seconds of detections with score 1, less the decay; from 0 to `confirm_seconds`.
    confirmed
        Whether the evidence has ever been enough to show it.
    id
        Assigned when it is first shown.
    unseen
        Seconds without a detection, up to the latest frame.
    hidden
        Seconds of these in which a nearer vehicle hid it.
    doubtful
        Seconds without a detection that adds evidence.
    scores
        Mean score of the latest detections, 0 to 1; a frame without one counts as 0.
    detection_scores
        The same, without frames that have no detection.
    votes
        Votes of all detections for its class.
    history
        Its moments in the latest frames.
    begin
        Time of its first detection, seconds.
    since
        Time of the first detection since it was last lost, seconds.
    appearance
        Mean appearance of its latest detections, `(2, 3)`.
    """

    def __init__(self, first: Observation, look: Look, settings: MotionTrackerSettings) -> None:
        self._settings = settings
        self.state = MotionState.at_rest(first.box, first.noise, look.size)
        self.history = History(Moment(look.time, self.state, first.score))
        self.begin = self.since = look.time
        self.appearance = first.appearance
        self.evidence = self.unseen = self.hidden = self.doubtful = 0.0
        self.confirmed = False
        self.id: int | None = None
        self.scores, self.detection_scores = RecentMean(), RecentMean()
        self.votes = ClassVotes()
        self._add(first, look)

    @property
    def is_present(self) -> bool:
        """Whether it is confirmed and was seen recently."""
        longest = self._settings.coast_seconds
        is_seen = self.unseen <= longest and self.doubtful <= max(longest, _LONGEST_DOUBT)
        return self.confirmed and self.evidence > 0 and is_seen

    @property
    def age(self) -> float:
        """Seconds since its first detection."""
        return self.history.moments[-1].time - self.begin

    @property
    def is_over(self) -> bool:
        """Whether to forget it."""
        if not self.confirmed:
            return self.evidence <= 0
        in_the_open = self.unseen - self.hidden
        longest = self._settings.keep_hidden_id_seconds
        return in_the_open > self._settings.keep_id_seconds or self.hidden > longest

    def predict(self, seconds: float) -> None:
        """Move on to the next frame, `seconds` later."""
        self.state = self.state.predicted(seconds)

    def see(self, observation: Observation, look: Look) -> None:
        """Add its detection in a frame."""
        self.state = self.state.corrected(observation.box, observation.noise, look.size)
        self.history.add(Moment(look.time, self.state, observation.score))
        if not self.is_present:
            self.since = look.time
        self.unseen = self.hidden = 0.0
        kept = math.exp(-look.seconds / _APPEARANCE_TIME)
        self.appearance = kept * self.appearance + (1 - kept) * observation.appearance
        self._add(observation, look)

    def miss(self, look: Look) -> None:
        """Add a frame without a detection of it."""
        self.unseen += look.seconds
        lost = self.unseen > self._settings.coast_seconds
        motion = math.exp(-look.seconds / _SLOWING_TIME) if lost else 1.0
        self.state = self.state.slowed(motion, math.exp(-look.seconds / _SETTLING_TIME))
        self.history.add(Moment(look.time, self.state))
        self._weigh(0.0, look.seconds)

    def lose(self) -> None:
        """Mark it as lost: its latest detection shows another vehicle."""
        self.evidence = 0.0
        self.unseen = max(self.unseen, self._settings.coast_seconds)

    def take_over(self, other: "Vehicle") -> None:
        """Continue the id, history and votes of another track of the same vehicle."""
        self.id = self.id if other.id is None else other.id
        self.begin = min(self.begin, other.begin)
        self.history.join(other.history)
        self.votes.join(other.votes)

    def merge(self, other: "Vehicle") -> None:
        """Take over the history of another track that now shows the same vehicle.

        The id is that of the track that has not been lost for longer.
        """
        ids = [(item.since, item.id) for item in (self, other) if item.id is not None]
        self.take_over(other)
        self.id = min(ids)[1] if ids else None
        self.since = min(self.since, other.since)

    def _add(self, observation: Observation, look: Look) -> None:
        self._weigh(observation.score, look.seconds)
        self.detection_scores.add(observation.score, look.seconds)
        weight = vote_weight(observation.box, observation.score, look.size)
        self.votes.add(observation.classes, weight * min(look.seconds, LONGEST_LOOK))

    def _weigh(self, score: float, seconds: float) -> None:
        self.doubtful = 0.0 if score >= self._settings.decay else self.doubtful + seconds
        gained = (score - self._settings.decay) * min(seconds, LONGEST_LOOK)
        self.evidence = min(max(self.evidence + gained, 0.0), self._settings.confirm_seconds)
        self.confirmed |= self.evidence >= self._settings.confirm_seconds
        self.scores.add(score, seconds)
