"""The two lines of a lane as curves on the ground, as a camera sees them.

Lines of one lane bend alike, so they share curvature and heading; each has its own place. A car
that pitches up or down sees straight parallel lines run together or apart. With z the distance
ahead at which a point appears (`view`), the camera sees each line at::

    seen(z) = 1 - pitch · z
    x(z) = place · seen(z) + heading · z + bend · z² / seen(z)

This is place + heading · Z + bend · Z² at the true distance Z = z / seen(z), which a pitch makes
look like z, and all widths there like seen(z) times as large.
"""

from dataclasses import dataclass

import numpy as np

from vdet.geometry import Float64Array

_LEAST_SEEN = 0.3  # no pitch of a car that is on its wheels makes less of a width


@dataclass(frozen=True, slots=True)
class Curves:
    """Both lines of a lane: second order in the distance ahead, metres to the right."""

    bend: float
    """Half the curvature, 1/m, positive to the right."""
    heading: float
    left: float
    """Place of the left line beside the camera, metres."""
    right: float
    pitch: float
    """Tangent of the car's pitch by the camera's height, 1/m."""

    @property
    def width(self) -> float:
        """Width of the lane, metres."""
        return self.right - self.left

    @property
    def hold_camera(self) -> bool:
        """Whether the camera is between the lines."""
        return self.left < 0 < self.right

    def at(self, z: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Return x of the left and of the right line at distances `(n,)`, as the camera sees it."""
        seen = seen_width(z, self.pitch)
        common = self.heading * z + self.bend * z**2 / seen
        return self.left * seen + common, self.right * seen + common


def seen_width(z: Float64Array, pitch: float) -> Float64Array:
    """Return as how many metres a metre across is seen at distances `(n,)`."""
    return np.maximum(1 - pitch * z, _LEAST_SEEN)


@dataclass(frozen=True, slots=True)
class Paint:
    """Rows of paint that may belong to one line: distances and lateral places, metres, `(n,)`."""

    z: Float64Array
    x: Float64Array


NONE = Paint(np.empty(0), np.empty(0))
