"""One vehicle: its motion, the evidence for it, and its score.

The evidence for a vehicle is a running sum that leaks, as in Page, "Continuous Inspection
Schemes", 1954: detections whose score is below the leak never add up, however long they last.
It is measured in seconds of detections with score 1, so that it does not depend on the frame rate.
"""

import math
from dataclasses import dataclass, field

from vdet.boxes import Float64Array
from vdet.config.schema import MotionTrackerSettings
from vdet.detect.classes import ClassScores
from vdet.track.motion.state import MotionState, measure

LONGEST_LOOK = 0.1
"""Seconds for which one frame counts as evidence at most: a single frame must not be enough."""

SCORE_TIME = 0.5
"""Seconds over which the scores of detections are averaged."""

_SLOWING_TIME = 0.8
"""Seconds in which the velocity of a vehicle unseen for longer than it is carried falls to 1/e."""

_SETTLING_TIME = 0.4
"""The same of the change of its size, from the first miss on: growth soon adds up to a lot."""

_NOISE = 0.1
"""Standard deviation of the sides of a detection with score 1, as a share of the vehicle's size."""

_ACCELERATION = 1.0
"""Standard deviation of the change of velocity in a second, sizes of the vehicle a second."""

_VELOCITY = 2.5
"""Standard deviation of a new vehicle's velocity, sizes of the vehicle a second."""

_LEAST_SCORE = 0.05
"""Below this score the box of a detection is not taken to be any less exact."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """A detection inside the frame: `box` is x1, y1, x2, y2 in pixels, float64 `(4,)`."""

    box: Float64Array
    score: float
    class_name: str | None = None


@dataclass(eq=False, slots=True)
class _RecentMean:
    """A mean of values over the latest `SCORE_TIME`; older ones count less and less."""

    _sum: float = 0.0
    _weight: float = 0.0

    @property
    def value(self) -> float:
        return self._sum / self._weight

    def add(self, value: float, seconds: float) -> None:
        kept = math.exp(-seconds / SCORE_TIME)
        self._sum = kept * self._sum + (1 - kept) * value
        self._weight = kept * self._weight + (1 - kept)


@dataclass(eq=False, slots=True)
class Vehicle:
    """What is remembered of a vehicle.

    Attributes
    ----------
    state
        Its motion up to the latest frame.
    evidence
        Seconds of detections with score 1, less the leak; from 0 to `needed`.
    confirmed
        Whether the evidence was enough once; only then it is shown.
    id
        Given when it is first shown.
    unseen
        Seconds without a detection, up to the latest frame.
    hidden
        How many of them it was hidden by a nearer vehicle.
    """

    state: MotionState
    evidence: float = 0.0
    confirmed: bool = False
    id: int | None = None
    unseen: float = 0.0
    hidden: float = 0.0
    _scores: _RecentMean = field(default_factory=_RecentMean)
    _detection_scores: _RecentMean = field(default_factory=_RecentMean)
    _class_scores: ClassScores = field(default_factory=ClassScores)

    @classmethod
    def new(
        cls, observation: Observation, seconds: float, settings: MotionTrackerSettings
    ) -> "Vehicle":
        """Make a vehicle of its first detection, `seconds` after the frame before."""
        state = MotionState.at_rest(observation.box, _noise(observation), _VELOCITY)
        vehicle = cls(state)
        vehicle._add(observation, seconds, settings)
        return vehicle

    @property
    def score(self) -> float:
        """Mean score of the latest detections, 0 to 1; a frame without one counts as 0."""
        return self._scores.value

    @property
    def detection_score(self) -> float:
        """The same, without the frames that have no detection."""
        return self._detection_scores.value

    @property
    def class_name(self) -> str | None:
        """The class with the highest sum of scores."""
        return self._class_scores.best

    def predict(self, seconds: float) -> None:
        """Move on to the next frame, `seconds` later."""
        self.state = self.state.predicted(seconds, _ACCELERATION)

    def see(
        self,
        observation: Observation,
        seconds: float,
        size: tuple[int, int],
        settings: MotionTrackerSettings,
    ) -> None:
        """Take in its detection in this frame of `size`, width and height in pixels."""
        edge = measure(self.state, observation.box, size)
        noise = _noise(observation)
        self.state = edge.state.corrected(edge.measured, noise, edge.seen)
        self.unseen = self.hidden = 0.0
        self._add(observation, seconds, settings)

    def miss(self, seconds: float, settings: MotionTrackerSettings) -> None:
        """Note a frame without a detection of it."""
        self.unseen += seconds
        lost = self.unseen > settings.carried
        motion = math.exp(-seconds / _SLOWING_TIME) if lost else 1.0
        self.state = self.state.slowed(motion, math.exp(-seconds / _SETTLING_TIME))
        self._weigh(0.0, seconds, settings)

    def is_present(self, settings: MotionTrackerSettings) -> bool:
        """Tell whether it is known and was seen lately."""
        return self.confirmed and self.evidence > 0 and self.unseen <= settings.carried

    def is_over(self, settings: MotionTrackerSettings) -> bool:
        """Tell whether to forget it."""
        if not self.confirmed:
            return self.evidence <= 0
        in_the_open = self.unseen - self.hidden
        return in_the_open > settings.remembered or self.hidden > settings.remembered_hidden

    def _add(
        self, observation: Observation, seconds: float, settings: MotionTrackerSettings
    ) -> None:
        self._weigh(observation.score, seconds, settings)
        self._detection_scores.add(observation.score, seconds)
        self._class_scores.add(observation.class_name, observation.score)

    def _weigh(self, score: float, seconds: float, settings: MotionTrackerSettings) -> None:
        gained = (score - settings.leak) * min(seconds, LONGEST_LOOK)
        self.evidence = min(max(self.evidence + gained, 0.0), settings.needed)
        self.confirmed |= self.evidence >= settings.needed
        self._scores.add(score, seconds)


def _noise(observation: Observation) -> float:
    """Return the deviation of a detection's box: its variance grows as the score falls."""
    return float(_NOISE / max(observation.score, _LEAST_SCORE) ** 0.5)
