"""Position and size of a vehicle and their changes: a constant-velocity Kalman filter.

Source: Kalman, "A New Approach to Linear Filtering and Prediction Problems", 1960; the model of
nearly constant velocity is that of Bar-Shalom, Li and Kirubarajan, "Estimation with Applications
to Tracking and Navigation", 2001, section 6.2.2 (white noise acceleration in continuous time).

x and y of the centre and the logarithms of width and height are four independent filters. All
uncertainties are fractions of the vehicle's size, so that near and far vehicles, and small and
large frames, are treated alike; times are in seconds.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from vdet.boxes import EDGE, Float64Array

_MAX_NEARER = 0.3
"""Maximum change of the distance in a step, as a fraction of it."""

_MAX_NEARER_RATE = 0.75
"""The same per second: a vehicle emerging from behind another seems to approach faster."""

_ACCELERATION = 0.8
"""Standard deviation of the change of velocity in a second, sizes of the vehicle per second."""

_VELOCITY = 2.5
"""Standard deviation of a new vehicle's velocity, sizes of the vehicle per second."""


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
    (width, height), (x1, y1, x2, y2) = size, box.tolist()
    across = (x1 <= EDGE * width) - (x2 >= width - EDGE * width)
    return across, (y1 <= EDGE * height) - (y2 >= height - EDGE * height)


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
