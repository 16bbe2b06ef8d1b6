"""A tracked vehicle: its motion, the evidence for it, and its score.

Position and size and their changes are estimated by a constant-velocity Kalman filter (Kalman, "A
New Approach to Linear Filtering and Prediction Problems", 1960). The model of nearly constant
velocity is that of Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and
Navigation", 2001, section 6.2.2 (white noise acceleration in continuous time). x and y of the
centre and the logarithms of width and height are four independent filters. All uncertainties are
fractions of the vehicle's size, so that near and far vehicles, and small and large frames, are
treated alike; times are in seconds.

The filter uses only earlier frames. Later frames then correct its estimates (`History`; Rauch, Tung
and Striebel, "Maximum Likelihood Estimates of Linear Dynamic Systems", 1965).

The evidence for a vehicle is a running sum that leaks, as in Page, "Continuous Inspection
Schemes", 1954: detections whose score is below the leak never add up, however long they last.
It is measured in seconds of detections with score 1, so that it does not depend on the frame rate.
"""

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from vdet.boxes import Float64Array, cut_sides
from vdet.config.schema import MotionTrackerSettings
from vdet.track.track import ClassVotes, State, vote_weight

_MAX_NEARER = 0.3
"""Maximum change of the distance in a step, as a fraction of it."""

_MAX_NEARER_RATE = 0.75
"""The same per second: a vehicle emerging from behind another seems to approach faster."""

_ACCELERATION = 0.8
"""Standard deviation of the change of velocity in a second, sizes of the vehicle per second."""

_VELOCITY = 2.5
"""Standard deviation of a new vehicle's velocity, sizes of the vehicle per second."""

SCORE_TIME = 0.5
"""Seconds over which the scores of detections are averaged."""

_ENTRY = 0.4
"""Seconds before its first detection during which an entering vehicle is shown."""

_ENTERING = 0.1
"""Minimum speed of a vehicle that enters the frame, in its sizes per second."""

_MAX_EVIDENCE_SECONDS = 0.1
"""Maximum seconds that one frame counts as evidence: a single frame must not be enough."""

_MAX_DOUBT = 0.6
"""Maximum seconds that detections below the decay keep a vehicle present; at least `coast_seconds`.

In the distance, such weak detections lead from one vehicle to the next.
"""

_SLOWING_TIME = 0.8
"""Seconds in which the velocity of a vehicle unseen for over `coast_seconds` falls to 1/e."""

_SETTLING_TIME = 0.4
"""The same for the change of its size, from the first miss on, because growth adds up quickly."""

_APPEARANCE_TIME = 0.3
"""Seconds over which the appearance of the detections is averaged."""

_LEAVING = 0.1
"""Minimum speed of a vehicle that leaves the frame, in its sizes per second."""

_NOISE = 0.12
"""Standard deviation of the sides of a detection with score 1, as a fraction of the vehicle's size.
"""

_MIN_SCORE = 0.05
"""Below this score, the noise of a box does not increase further."""


@dataclass(frozen=True, slots=True, eq=False)
class MotionState:
    """An estimate and its uncertainty.

    Attributes
    ----------
    mean
        float64 `(4, 2)`: centre x and y in full-frame pixels, log width and log height of the
        whole vehicle in pixels; each with its change per second.
    covariance
        float64 `(4, 2, 2)`: of each of the four and its change; lengths in fractions of the
        vehicle's width (x) and height (y).
    expected
        The mean before the correction by this frame; None in the first frame.
    gain
        Gain by which a correction of this state corrects that of the previous frame, `(4, 2, 2)`;
        None in the first frame.
    ways_in
        For x and y the direction into the frame, 1 or -1, if one of its sides cuts off the detected
        box; 0 if none or both do.
    """

    mean: Float64Array
    covariance: Float64Array
    expected: Float64Array | None = None
    gain: Float64Array | None = None
    ways_in: tuple[int, int] = (0, 0)

    @classmethod
    def at_rest(cls, box: Float64Array, noise: float, size: tuple[int, int]) -> Self:
        """Start at `box` with velocity 0; arguments as for `corrected`."""
        mean = np.zeros((4, 2))
        mean[:, 0] = _measurement(box)
        covariance = np.tile(np.diag([noise**2, _VELOCITY**2]), (4, 1, 1))
        return cls(mean, covariance, ways_in=_ways_in(box, size))

    @property
    def velocity(self) -> Float64Array:
        """Velocity of the centre, x and y in sizes of the vehicle per second, `(2,)`."""
        return np.asarray(self.mean[:2, 1] / np.exp(self.mean[2:, 0]))

    @property
    def deviation(self) -> Float64Array:
        """Standard deviation of the centre's x and y, `(2,)`, fractions of width and height."""
        return np.sqrt(self.covariance[:2, 0, 0])

    def moved(self, seconds: float) -> Float64Array:
        """Return the mean `seconds` later.

        A vehicle that approaches at constant speed grows and moves ever faster in the image: at a
        distance Z, size and position scale with 1 / Z and velocity with 1 / Z².
        """
        most = min(_MAX_NEARER, _MAX_NEARER_RATE * abs(seconds))
        nearer = float(np.clip(np.mean(self.mean[2:, 1]) * seconds, -most, most))
        growth = 1 / (1 - nearer)
        mean = self.mean @ np.array([[1.0, 0.0], [seconds, 1.0]])
        mean[:2, 0] += self.mean[:2, 1] * seconds * (growth - 1)
        mean[:2, 1] *= growth**2
        return np.asarray(mean)

    def predicted(self, seconds: float) -> "MotionState":
        """Return the prediction for the next frame, `seconds` later."""
        step = np.array([[1.0, seconds], [0.0, 1.0]])
        drift = np.array([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]])
        covariance = step @ self.covariance @ step.T + _ACCELERATION**2 * drift
        gain = self.covariance @ step.T @ np.linalg.inv(covariance)
        mean = self.moved(seconds)
        return MotionState(mean, covariance, mean, gain)

    def corrected(self, box: Float64Array, noise: float, size: tuple[int, int]) -> "MotionState":
        """Return the state corrected by a detected box.

        Parameters
        ----------
        box
            x1, y1, x2, y2 in full-frame pixels, inside the frame, with an area.
        noise
            Its standard deviation, in fractions of the vehicle's size.
        size
            Width and height of the frame, pixels.
        """
        ways_in = _ways_in(box, size)
        mean, measured, seen = _measured(self.mean, box, ways_in)
        unit = np.array([*np.exp(mean[2:, 0]), 1.0, 1.0])
        error = (measured - mean[:, 0]) / unit
        gain = self.covariance[:, :, 0] / (self.covariance[:, 0, 0] + noise**2)[:, np.newaxis]
        gain *= seen[:, np.newaxis]
        return MotionState(
            mean + gain * (error * unit)[:, np.newaxis],
            self.covariance - gain[:, :, np.newaxis] * self.covariance[:, np.newaxis, 0],
            mean,
            self.gain,
            ways_in,
        )

    def slowed(self, motion: float, growth: float) -> "MotionState":
        """Multiply the velocity by `motion`, the change of the size by `growth`."""
        mean = self.mean * np.array([[1, motion], [1, motion], [1, growth], [1, growth]])
        return MotionState(mean, self.covariance, mean, self.gain)


def whole_box(mean: Float64Array) -> Float64Array:
    """Return x1, y1, x2, y2 in pixels of centre x and y and log width and height, `(…, 4)`."""
    half = np.exp(mean[..., 2:]) / 2
    return np.concatenate([mean[..., :2] - half, mean[..., :2] + half], axis=-1)


def _ways_in(box: Float64Array, size: tuple[int, int]) -> tuple[int, int]:
    cut = cut_sides(box.tolist(), size)
    return cut.left - cut.right, cut.top - cut.bottom


def _measurement(box: Float64Array) -> Float64Array:
    """Return centre x and y and log width and height, `(4,)`, of a box of x1, y1, x2, y2."""
    return np.concatenate([(box[:2] + box[2:]) / 2, np.log(box[2:] - box[:2])])


def _measured(
    expected: Float64Array, box: Float64Array, ways_in: tuple[int, int]
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return the mean to correct, the measurement, and 1 or 0 for each of the four if measured.

    The box of a vehicle that enters at a side grows with every frame although the vehicle does not,
    and its centre moves at half the vehicle's speed. So only the inner edge of a cut-off box
    counts; the width is kept, or set to the visible part if that is larger. The same holds for the
    height at the top and bottom.
    """
    mean, measured, seen = expected.copy(), _measurement(box), np.ones(4)
    for axis, way in enumerate(ways_in):
        if not way:
            continue
        inner = box[axis + 2] if way > 0 else box[axis]
        visible, length = box[axis + 2] - box[axis], np.exp(mean[axis + 2, 0])
        if visible > length:
            mean[axis, 0] -= way * (visible - length) / 2  # the inner edge stays
            mean[axis + 2, 0] = measured[axis + 2]
            length = visible
        mean[axis + 2, 1] = 0
        measured[axis] = inner - way * length / 2
        seen[axis + 2] = 0
    return mean, measured, seen


@dataclass(frozen=True, slots=True, eq=False)
class StateEstimate:
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

    def __init__(self, first: StateEstimate) -> None:
        self.estimates = [first]
        self._smoothed: list[Float64Array] | None = None

    @property
    def last_seen(self) -> StateEstimate:
        """The latest estimate with a detection."""
        return next(estimate for estimate in reversed(self.estimates) if estimate.score is not None)

    def add(self, estimate: StateEstimate) -> None:
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


@dataclass(frozen=True, slots=True)
class FrameStep:
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
        decay = math.exp(-seconds / SCORE_TIME)
        self._sum = decay * self._sum + (1 - decay) * value
        self._weight = decay * self._weight + (1 - decay)


class TrackedVehicle:
    """A tracked vehicle.

    Parameters
    ----------
    first, frame
        Its first detection, and the searched frame.

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
        Its estimates in the latest frames.
    begin
        Time of its first detection, seconds.
    since
        Time of the first detection since it was last lost, seconds.
    appearance
        Mean appearance of its latest detections, `(2, 3)`.
    """

    def __init__(
        self, first: Observation, frame: FrameStep, settings: MotionTrackerSettings
    ) -> None:
        self._settings = settings
        self.state = MotionState.at_rest(first.box, first.noise, frame.size)
        self.history = History(StateEstimate(frame.time, self.state, first.score))
        self.begin = self.since = frame.time
        self.appearance = first.appearance
        self.evidence = self.unseen = self.hidden = self.doubtful = 0.0
        self.confirmed = False
        self.id: int | None = None
        self.scores, self.detection_scores = RecentMean(), RecentMean()
        self.votes = ClassVotes()
        self._add(first, frame)

    @property
    def is_present(self) -> bool:
        """Whether it is confirmed and was seen recently."""
        longest = self._settings.coast_seconds
        is_seen = self.unseen <= longest and self.doubtful <= max(longest, _MAX_DOUBT)
        return self.confirmed and self.evidence > 0 and is_seen

    @property
    def age(self) -> float:
        """Seconds since its first detection."""
        return self.history.estimates[-1].time - self.begin

    @property
    def is_over(self) -> bool:
        """Whether to forget it."""
        if not self.confirmed:
            return self.evidence <= 0
        last = self.history.last_seen.state
        if (last.velocity * last.ways_in).min() < -_LEAVING:  # a side cut it off, and it moved out
            return self.unseen > self._settings.coast_seconds
        in_the_open = self.unseen - self.hidden
        longest = self._settings.keep_hidden_id_seconds
        return in_the_open > self._settings.keep_id_seconds or self.hidden > longest

    def predict(self, seconds: float) -> None:
        """Move on to the next frame, `seconds` later."""
        self.state = self.state.predicted(seconds)

    def see(self, observation: Observation, frame: FrameStep) -> None:
        """Add its detection in a frame."""
        self.state = self.state.corrected(observation.box, observation.noise, frame.size)
        self.history.add(StateEstimate(frame.time, self.state, observation.score))
        if not self.is_present:
            self.since = frame.time
        self.unseen = self.hidden = 0.0
        decay = math.exp(-frame.seconds / _APPEARANCE_TIME)
        self.appearance = decay * self.appearance + (1 - decay) * observation.appearance
        self._add(observation, frame)

    def miss(self, frame: FrameStep) -> None:
        """Add a frame without a detection of it."""
        self.unseen += frame.seconds
        lost = self.unseen > self._settings.coast_seconds
        motion = math.exp(-frame.seconds / _SLOWING_TIME) if lost else 1.0
        self.state = self.state.slowed(motion, math.exp(-frame.seconds / _SETTLING_TIME))
        self.history.add(StateEstimate(frame.time, self.state))
        self._weigh(0.0, frame.seconds)

    def lose(self) -> None:
        """Mark it as lost: its latest detection shows another vehicle."""
        self.evidence = 0.0
        self.unseen = max(self.unseen, self._settings.coast_seconds)

    def take_over(self, earlier: "TrackedVehicle") -> None:
        """Continue the id, history and votes of another track of the same vehicle."""
        self.id = self.id if earlier.id is None else earlier.id
        self.begin = min(self.begin, earlier.begin)
        self.history.join(earlier.history)
        self.votes.join(earlier.votes)

    def merge(self, duplicate: "TrackedVehicle") -> None:
        """Take over the history of another track that now shows the same vehicle.

        The id is that of the track that has not been lost for longer.
        """
        ids = [(item.since, item.id) for item in (self, duplicate) if item.id is not None]
        self.take_over(duplicate)
        self.id = min(ids)[1] if ids else None
        self.since = min(self.since, duplicate.since)

    def _add(self, observation: Observation, frame: FrameStep) -> None:
        self._weigh(observation.score, frame.seconds)
        self.detection_scores.add(observation.score, frame.seconds)
        weight = vote_weight(observation.box, observation.score, frame.size)
        self.votes.add(observation.classes, weight * min(frame.seconds, _MAX_EVIDENCE_SECONDS))

    def _weigh(self, score: float, seconds: float) -> None:
        self.doubtful = 0.0 if score >= self._settings.decay else self.doubtful + seconds
        gained = (score - self._settings.decay) * min(seconds, _MAX_EVIDENCE_SECONDS)
        self.evidence = min(max(self.evidence + gained, 0.0), self._settings.confirm_seconds)
        self.confirmed |= self.evidence >= self._settings.confirm_seconds
        self.scores.add(score, seconds)
