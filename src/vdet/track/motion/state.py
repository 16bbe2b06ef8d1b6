"""Where a vehicle is, how large, and how both change: a constant-velocity Kalman filter.

Source: Kalman, "A New Approach to Linear Filtering and Prediction Problems", 1960; the model of
nearly constant velocity is that of Bar-Shalom, Li and Kirubarajan, "Estimation with Applications
to Tracking and Navigation", 2001, section 6.3.2.

The centre's x and y and the logarithms of width and height are four filters of their own. All
uncertainty is in shares of the vehicle's size, so that near and far vehicles, and small and large
frames, are treated alike.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from vdet.geometry import Float64Array

_STEP = np.array([[1.0, 1.0], [0.0, 1.0]])
_JERK = np.array([[0.25, 0.5], [0.5, 1.0]])  # of one acceleration, constant for a frame


@dataclass(frozen=True, slots=True, eq=False)
class MotionState:
    """An estimate and its uncertainty.

    Attributes
    ----------
    mean
        float64 `(4, 2)`: centre x and y in full-frame pixels, log width and log height of the
        whole vehicle in pixels; each with its change a frame.
    covariance
        float64 `(4, 2, 2)`: of each of the four and its change; lengths in shares of the vehicle's
        width (x) and height (y).
    """

    mean: Float64Array
    covariance: Float64Array

    @classmethod
    def at_rest(cls, box: Float64Array, noise: float, velocity: float) -> Self:
        """Start at `box`, known to `noise`; its velocity is 0, give or take `velocity`."""
        mean = np.zeros((4, 2))
        mean[:, 0] = measurement_of(box)
        return cls(mean, np.tile(np.diag([noise**2, velocity**2]), (4, 1, 1)))

    @property
    def box(self) -> Float64Array:
        """The vehicle's x, y, width, height in full-frame pixels, float64 `(4,)`; not clipped."""
        size = np.exp(self.mean[2:, 0])
        return np.concatenate([self.mean[:2, 0] - size / 2, size])

    def predicted(self, acceleration: float) -> "MotionState":
        """Go one frame on; `acceleration` is the deviation of the velocity's change in it."""
        covariance = _STEP @ self.covariance @ _STEP.T + acceleration**2 * _JERK
        return MotionState(self.mean @ _STEP.T, covariance)

    def corrected(self, measured: Float64Array, noise: float, seen: Float64Array) -> "MotionState":
        """Take in a measurement.

        Parameters
        ----------
        measured
            Shape `(4,)`, as `measurement_of` gives it.
        noise
            Its standard deviation, in shares of the vehicle's size.
        seen
            Shape `(4,)`, 1 where it was measured and 0 where it could not be.
        """
        unit = self._unit()
        error = (measured - self.mean[:, 0]) / unit
        gain = self.covariance[:, :, 0] / (self.covariance[:, 0, 0] + noise**2)[:, np.newaxis]
        gain *= seen[:, np.newaxis]
        return MotionState(
            self.mean + gain * (error * unit)[:, np.newaxis],
            self.covariance - gain[:, :, np.newaxis] * self.covariance[:, np.newaxis, 0],
        )

    def slowed(self, motion: float, growth: float) -> "MotionState":
        """Multiply the velocity by `motion`, the change of the size by `growth`."""
        factors = np.array([[1, motion], [1, motion], [1, growth], [1, growth]])
        return replace(self, mean=self.mean * factors)

    def _unit(self) -> Float64Array:
        width, height = np.exp(self.mean[2:, 0])
        return np.array([width, height, 1.0, 1.0])


def measurement_of(box: Float64Array) -> Float64Array:
    """Return centre x and y and log width and height, `(4,)`, of an x, y, width, height box."""
    return np.concatenate([box[:2] + box[2:] / 2, np.log(box[2:])])
