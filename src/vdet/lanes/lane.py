"""What is told of the lane in a frame."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Polyline = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Lane:
    """The lane that the camera is in, in metres, and its lines in the undistorted frame."""

    curvature: float
    """1/m, positive to the right; smoothed over more frames than the lines."""
    radius: float | None
    """Of the bend, metres; None where the road is straight (`lanes.track.straight`)."""
    offset: float
    """Of the camera from the lane's middle, metres, positive to the right."""
    width: float
    """Metres."""
    left: Polyline
    """The left line, pixels `(n, 2)` of the undistorted frame, the nearest point first."""
    right: Polyline
    """The right line, likewise."""
