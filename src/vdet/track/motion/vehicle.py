"""One vehicle: its motion, the evidence for it, and its score.

The evidence for a vehicle is a running sum that leaks, as in Page, "Continuous Inspection
Schemes", 1954: detections whose score is below the leak never add up, however long they last.
It is measured in seconds of detections with score 1, so that it does not depend on the frame rate.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from vdet.boxes import Float64Array
from vdet.config.schema import MotionTrackerSettings
from vdet.track.motion.state import SCORE_TIME, History, MotionState, StateEstimate
from vdet.track.votes import ClassVotes, vote_weight

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
    def has_left(self) -> bool:
        """Whether a side of the frame cut it off when it was last seen, and it was moving out."""
        last = self.history.last_seen.state
        return bool((last.velocity * last.ways_in).min() < -_LEAVING)

    @property
    def is_over(self) -> bool:
        """Whether to forget it."""
        if not self.confirmed:
            return self.evidence <= 0
        if self.has_left:
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
