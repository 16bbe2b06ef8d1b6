import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.synthetic.scene import NEAR, PinholeCamera, beyond_near

metres = st.floats(-50, 50)


def test_projection_is_that_of_a_pinhole() -> None:
    camera = PinholeCamera(800, 600, focal=1000, horizon=300, above_ground=1.2)
    [[u, v]] = camera.project(np.array([[2.0, 0.0, 20.0]]))
    assert (u, v) == pytest.approx((400 + 1000 * 2 / 20, 300 + 1000 * 1.2 / 20))


def test_a_right_hand_bend_moves_the_road_by_half_its_curvature_times_distance_squared() -> None:
    straight, bent = (PinholeCamera.dashboard(1280, 720, curvature) for curvature in (0.0, 1 / 500))
    point = np.array([[1.0, 0.0, 40.0]])
    moved = straight.project(point + np.array([40.0**2 / 2 / 500, 0, 0]))
    assert bent.project(point) == pytest.approx(moved)


@given(st.lists(st.tuples(metres, metres, metres), min_size=3, max_size=6))
def test_cutting_leaves_nothing_nearer_than_near(corners: list[tuple[float, ...]]) -> None:
    polygon = np.array(corners)
    kept = beyond_near(polygon)
    assert (kept[:, 2] >= NEAR - 1e-9).all()
    assert len(kept) >= (polygon[:, 2] >= NEAR).sum()
