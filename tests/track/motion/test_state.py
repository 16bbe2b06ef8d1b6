"""How the state of a vehicle moves on."""

import numpy as np
import pytest

from vdet.track.motion.vehicle import MotionState


@pytest.mark.parametrize("seconds", [-0.4, -0.1, 0.1, 0.4])
def test_what_drives_evenly_was_slower_and_becomes_faster_in_the_picture(seconds: float) -> None:
    """Its distance changes evenly; its place from the vanishing point is 1 / distance."""
    rate = 0.5  # by which its size grows in a second
    mean = np.array([[400, 400 * rate], [200, 200 * rate], [np.log(90), rate], [np.log(60), rate]])
    state = MotionState(mean, np.tile(np.eye(2), (4, 1, 1)))
    nearer = 1 / (1 - rate * seconds)
    velocities = mean[:2, 1] * nearer**2
    assert state.moved(seconds)[:2] == pytest.approx(
        np.column_stack([[400 * nearer, 200 * nearer], velocities])
    )
