"""One vehicle: its motion, and how sure of it we are.

The evidence for a vehicle is a running sum that leaks, as in Page, "Continuous Inspection
Schemes", 1954: what is weaker than the leak never adds up, however long it lasts.
"""

from dataclasses import dataclass

from vdet.config.schema import MotionTrackerSettings
from vdet.geometry import Float64Array
from vdet.track.motion.state import MotionState
from vdet.track.motion.views import view

_SLOWING = 0.95
"""What is left, a frame, of the velocity of a vehicle unseen for longer than it is carried."""

_SETTLING = 0.9
"""The same of the change of its size, from the first frame on: growth adds up to a lot soon."""

_FAINTEST = 0.05
"""Clearness below which a region's box is not thought to be any worse."""


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """A region: `box` is x, y, width, height in full-frame pixels, float64 `(4,)`, in the frame.

    `clearness` is its evidence, 0 to 1, 1 for a vehicle that is seen clearly.
    """

    box: Float64Array
    clearness: float


@dataclass(eq=False, slots=True)
class Vehicle:
    """What is remembered of a vehicle.

    Attributes
    ----------
    state
        Its motion up to the latest frame.
    evidence
        What speaks for it, in frames of clear sight; at most `needed`.
    confirmed
        Whether there was enough of it once; only then it is shown.
    id
        Given when it is first shown.
    misses
        Frames in a row without a region, up to the latest one.
    hidden_misses
        How many of them it was hidden in by a nearer vehicle.
    """

    state: MotionState
    evidence: float
    confirmed: bool = False
    id: int | None = None
    misses: int = 0
    hidden_misses: int = 0

    @classmethod
    def new(cls, sighting: Sighting, settings: MotionTrackerSettings) -> "Vehicle":
        """Make a vehicle of its first region."""
        noise = _noise(sighting, settings)
        return cls(
            MotionState.at_rest(sighting.box, noise, settings.velocity / 25),
            sighting.clearness - settings.leak,
        )

    def predict(self, settings: MotionTrackerSettings) -> None:
        """Move on to the next frame."""
        self.state = self.state.predicted(settings.acceleration / 125)

    def see(
        self, sighting: Sighting, size: tuple[int, int], settings: MotionTrackerSettings
    ) -> None:
        """Take in its region in this frame of `size`, width and height in pixels."""
        seen = view(self.state, sighting.box, size)
        self.state = seen.state.corrected(seen.measured, _noise(sighting, settings), seen.seen)
        self.misses = self.hidden_misses = 0
        self._weigh(sighting.clearness - settings.leak, settings)

    def miss(self, settings: MotionTrackerSettings) -> None:
        """Note a frame without a region for it."""
        self.misses += 1
        motion = _SLOWING if self.misses > settings.carried * 25 else 1.0
        self.state = self.state.slowed(motion, _SETTLING)
        self._weigh(-settings.leak, settings)

    def is_present(self, settings: MotionTrackerSettings) -> bool:
        """Tell whether it is known and was seen lately."""
        return self.confirmed and self.evidence > 0 and self.misses <= settings.carried * 25

    def is_over(self, settings: MotionTrackerSettings) -> bool:
        """Tell whether to forget it."""
        if not self.confirmed:
            return self.evidence <= 0
        in_the_open = self.misses - self.hidden_misses
        return (
            in_the_open > settings.remembered * 25
            or self.hidden_misses > settings.remembered_hidden * 25
        )

    def _weigh(self, evidence: float, settings: MotionTrackerSettings) -> None:
        self.evidence = min(max(self.evidence + evidence, 0.0), settings.needed * 25)
        self.confirmed |= self.evidence >= settings.needed * 25


def _noise(sighting: Sighting, settings: MotionTrackerSettings) -> float:
    """Return the deviation of a region's box: its variance grows as its votes become fewer."""
    return float(settings.noise / max(sighting.clearness, _FAINTEST) ** 0.5)
