"""Where a vehicle is, how large, and how both change: a constant-velocity Kalman filter.

Source: Kalman, "A New Approach to Linear Filtering and Prediction Problems", 1960; the model of
nearly constant velocity is that of Bar-Shalom, Li and Kirubarajan, "Estimation with Applications
to Tracking and Navigation", 2001, section 6.2.2 (white noise acceleration in continuous time).

The centre's x and y and the logarithms of width and height are four independent filters. All
uncertainty is in shares of the vehicle's size, so that near and far vehicles, and small and large
frames, are treated alike; times are seconds.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from vdet.boxes import Float64Array

_MOST_NEARER = 0.3
"""Largest change of the distance in a step that is believed, as a share of it."""

_MOST_NEARER_RATE = 0.75
"""The same of a second: what comes out from behind another vehicle seems to come nearer faster."""

BORDER = 0.005
"""A box that ends this near to the frame's side, as a share of the frame, touches it."""


@dataclass(frozen=True, slots=True, eq=False)
class MotionState:
    """An estimate and its uncertainty.

    Attributes
    ----------
    mean
        float64 `(4, 2)`: centre x and y in full-frame pixels, log width and log height of the
        whole vehicle in pixels; each with its change a second.
    covariance
        float64 `(4, 2, 2)`: of each of the four and its change; lengths in shares of the vehicle's
        width (x) and height (y).
    """

    mean: Float64Array
    covariance: Float64Array

    @classmethod
    def at_rest(cls, box: Float64Array, noise: float, velocity: float) -> Self:
        """Start at `box` with velocity 0; `noise` and `velocity` are their standard deviations."""
        mean = np.zeros((4, 2))
        mean[:, 0] = _measurement(box)
        return cls(mean, np.tile(np.diag([noise**2, velocity**2]), (4, 1, 1)))

    @property
    def box(self) -> Float64Array:
        """The vehicle's x1, y1, x2, y2 in full-frame pixels, float64 `(4,)`; not clipped."""
        return whole_box(self.mean[:, 0])

    @property
    def deviation(self) -> Float64Array:
        """Standard deviation of the centre's x and y, `(2,)`, shares of width and height."""
        return np.sqrt(self.covariance[:2, 0, 0])

    def predicted(self, seconds: float, acceleration: float) -> "MotionState":
        """Go on by `seconds`; `acceleration` is the deviation of the velocity after one second.

        What moves evenly on the road comes near as its size grows, and ever faster in the picture:
        with a distance of Z, size and place change by 1 / Z and velocity by 1 / Z².
        """
        step = np.array([[1.0, seconds], [0.0, 1.0]])
        most = min(_MOST_NEARER, _MOST_NEARER_RATE * seconds)
        nearer = float(np.clip(np.mean(self.mean[2:, 1]) * seconds, -most, most))
        growth = 1 / (1 - nearer)
        mean = self.mean @ step.T
        mean[:2, 0] += self.mean[:2, 1] * seconds * (growth - 1)
        mean[:2, 1] *= growth**2
        drift = np.array([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]])
        covariance = step @ self.covariance @ step.T + acceleration**2 * drift
        return MotionState(mean, covariance)

    def gain_from(self, expected: "MotionState", seconds: float) -> Float64Array:
        """Return how a correction of the state `seconds` later corrects this one, `(4, 2, 2)`.

        `expected` is that later state as `predicted` gives it.
        """
        step = np.array([[1.0, 0.0], [seconds, 1.0]])
        return np.asarray(self.covariance @ step @ np.linalg.inv(expected.covariance))

    def corrected(self, box: Float64Array, noise: float, size: tuple[int, int]) -> "MotionState":
        """Take in a detected box.

        Parameters
        ----------
        box
            x1, y1, x2, y2 in full-frame pixels, inside the frame, with an area.
        noise
            Its standard deviation, in shares of the vehicle's size.
        size
            Width and height of the frame, pixels.
        """
        mean, measured, seen = _measured(self.mean, box, size)
        unit = np.array([*np.exp(mean[2:, 0]), 1.0, 1.0])
        error = (measured - mean[:, 0]) / unit
        gain = self.covariance[:, :, 0] / (self.covariance[:, 0, 0] + noise**2)[:, np.newaxis]
        gain *= seen[:, np.newaxis]
        return MotionState(
            mean + gain * (error * unit)[:, np.newaxis],
            self.covariance - gain[:, :, np.newaxis] * self.covariance[:, np.newaxis, 0],
        )

    def enlarged(self, box: Float64Array, size: tuple[int, int]) -> "MotionState":
        """Return the state with the size that a box shows at least; parameters as of `corrected`.

        Of a vehicle that the frame's side cuts off, the inner edge stays where it is.
        """
        return replace(self, mean=_measured(self.mean, box, size)[0])

    def slowed(self, motion: float, growth: float) -> "MotionState":
        """Multiply the velocity by `motion`, the change of the size by `growth`."""
        factors = np.array([[1, motion], [1, motion], [1, growth], [1, growth]])
        return replace(self, mean=self.mean * factors)


def whole_box(mean: Float64Array) -> Float64Array:
    """Return x1, y1, x2, y2 in pixels of a centre x and y and log width and height, both `(4,)`."""
    half = np.exp(mean[2:]) / 2
    return np.concatenate([mean[:2] - half, mean[:2] + half])


def side_cut(box: Float64Array, size: tuple[int, int]) -> tuple[int, int] | None:
    """Return the axis on which one side of the frame cuts a box off, and the way into the frame.

    The axis is 0 for x or 1 for y, the way is 1 or -1. None if no side, or both of an axis, do.
    """
    for axis, span in enumerate(size):
        cut_before, cut_behind = _cuts(box, axis, span)
        if cut_before != cut_behind:
            return axis, 1 if cut_before else -1
    return None


def _cuts(box: Float64Array, axis: int, span: int) -> tuple[bool, bool]:
    """Return whether the near and the far side of the frame cut a box off."""
    return bool(box[axis] <= BORDER * span), bool(box[axis + 2] >= span - BORDER * span)


def _measurement(box: Float64Array) -> Float64Array:
    """Return centre x and y and log width and height, `(4,)`, of a box of x1, y1, x2, y2."""
    return np.concatenate([(box[:2] + box[2:]) / 2, np.log(box[2:] - box[:2])])


def _measured(
    expected: Float64Array, box: Float64Array, size: tuple[int, int]
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return the mean to correct, the measurement, and for each of the four 1 if it was seen, or 0.

    The box of a vehicle that comes in at a side grows with every frame though the vehicle does
    not, and its centre moves at half the vehicle's speed. So only the inner edge of a cut-off box
    counts; the width is what it was, or the visible part if that is more, and does not change by
    itself. Above and below it is the same with the height.
    """
    mean, measured, seen = expected.copy(), _measurement(box), np.ones(4)
    for axis, span in enumerate(size):
        first, last = box[axis], box[axis + 2]
        cut_before, cut_behind = _cuts(box, axis, span)
        if cut_before == cut_behind:
            continue
        outward = 1 if cut_behind else -1
        length = np.exp(mean[axis + 2, 0])
        if last - first > length:
            mean[axis, 0] += outward * (last - first - length) / 2  # the inner edge stays
            mean[axis + 2, 0] = measured[axis + 2]
            length = last - first
        mean[axis + 2, 1] = 0
        measured[axis] = (first if cut_behind else last) + outward * length / 2
        seen[axis + 2] = 0
    return mean, measured, seen
