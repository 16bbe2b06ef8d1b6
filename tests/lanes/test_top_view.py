"""The top view: ground, rows, columns and pixels agree."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.config.lanes import LaneSettings
from vdet.lanes.top_view import ALONG, TopView
from vdet.synthetic.camera import PinholeCamera

SettingsFor = Callable[[PinholeCamera], LaneSettings]


@pytest.fixture
def camera() -> PinholeCamera:
    return PinholeCamera.dashboard(1280, 720)


@pytest.fixture
def top_view(camera: PinholeCamera, settings_for: SettingsFor) -> TopView:
    return TopView(settings_for(camera), camera.width, camera.height)


def test_ground_points_lie_where_the_camera_sees_them(
    top_view: TopView, camera: PinholeCamera
) -> None:
    x, z = np.array([-1.85, 0, 1.85, 4.0]), np.array([6.0, 20.0, 42.0, 9.0])
    expected = camera.project(np.column_stack([x, np.zeros(4), z]))
    assert top_view.ground_to_frame(x, z) == pytest.approx(expected, abs=0.01)


def test_a_line_on_the_road_is_upright_and_at_its_position(
    top_view: TopView, camera: PinholeCamera
) -> None:
    frame = np.zeros((720, 1280, 3), np.uint8)
    ground = np.array([[0.9, 0, 5], [0.9, 0, 60], [1.1, 0, 60], [1.1, 0, 5]], float)
    cv2.fillPoly(frame, [np.rint(camera.project(ground)).astype(np.int32)], (255, 255, 255))
    lit = top_view.image(frame)[..., 0] > 127
    middle = (lit * top_view.laterals).sum(axis=1) / lit.sum(axis=1)
    assert np.abs(middle - 1.0).max() < 0.05


@given(x=st.floats(-4, 4), z=st.floats(7, 40))
def test_frame_and_top_view_pixels_show_the_same_ground(x: float, z: float) -> None:
    top_view = TopView(LaneSettings(), 1280, 720)
    [[column, row]] = top_view.frame_to_top(top_view.ground_to_frame(np.array([x]), np.array([z])))
    assert column == pytest.approx(top_view.columns(np.array([x]))[0], abs=1e-6)
    assert row == pytest.approx((top_view.distances[0] - z) * ALONG, abs=1e-6)


def test_the_trapezoid_may_be_measured_away_from_the_middle_of_the_lane(
    camera: PinholeCamera, settings_for: SettingsFor
) -> None:
    middle = settings_for(camera)
    shift = 0.5 * camera.focal / camera.width  # half a metre; divide by the distance
    moved = middle.model_copy(
        update={
            "top_left": middle.top_left - shift / 42,
            "top_right": middle.top_right - shift / 42,
            "bottom_left": middle.bottom_left - shift / 6,
            "bottom_right": middle.bottom_right - shift / 6,
        }
    )
    x, z = np.array([-1.0, 2.0]), np.array([10.0, 30.0])
    views = [TopView(settings, 1280, 720) for settings in (middle, moved)]
    assert views[0].ground_to_frame(x, z) == pytest.approx(views[1].ground_to_frame(x, z), abs=0.01)


def test_the_same_settings_fit_frames_of_any_size() -> None:
    x, z = np.array([-1.0, 2.0]), np.array([10.0, 30.0])
    small, large = (TopView(LaneSettings(), 640 * n, 360 * n).ground_to_frame(x, z) for n in (1, 3))
    assert small * 3 == pytest.approx(large, abs=0.01)
