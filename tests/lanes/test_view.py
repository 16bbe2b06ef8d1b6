"""The road from above: metres, rows, columns and pixels agree."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.config.lanes import LaneSettings, ViewSettings
from vdet.lanes.view import View
from vdet.synthetic.camera import PinholeCamera

SettingsFor = Callable[[PinholeCamera], LaneSettings]


@pytest.fixture
def camera() -> PinholeCamera:
    return PinholeCamera.dashboard(1280, 720)


@pytest.fixture
def view(camera: PinholeCamera, settings_for: SettingsFor) -> View:
    return View(settings_for(camera).view, camera.width, camera.height)


def test_metres_of_the_ground_lie_where_the_camera_sees_them(
    view: View, camera: PinholeCamera
) -> None:
    x, z = np.array([-1.85, 0, 1.85, 4.0]), np.array([6.0, 20.0, 42.0, 9.0])
    expected = camera.project(np.column_stack([x, np.zeros(4), z]))
    assert view.to_frame(x, z) == pytest.approx(expected, abs=0.01)


def test_rows_run_from_the_far_end_to_the_near_one(view: View) -> None:
    assert len(view.distances) == 36 * 8
    assert view.distances[0] == pytest.approx(42 - 1 / 16, abs=0.01)
    assert view.distances[-1] == pytest.approx(6 + 1 / 16, abs=0.01)


def test_columns_lie_evenly_about_the_vanishing_points_column(view: View) -> None:
    assert len(view.laterals) == round(9.7 * 30)
    assert view.laterals[0] == pytest.approx(-view.laterals[-1])
    assert view.columns(view.laterals) == pytest.approx(np.arange(len(view.laterals)))


def test_a_line_on_the_road_is_upright_and_where_it_should_be(
    view: View, camera: PinholeCamera
) -> None:
    frame = np.zeros((720, 1280, 3), np.uint8)
    ground = np.array([[0.9, 0, 5], [0.9, 0, 60], [1.1, 0, 60], [1.1, 0, 5]], float)
    cv2.fillPoly(frame, [np.rint(camera.project(ground)).astype(np.int32)], (255, 255, 255))
    lit = view.from_above(frame)[..., 0] > 127
    middle = (lit * view.laterals).sum(axis=1) / lit.sum(axis=1)
    assert np.abs(middle - 1.0).max() < 0.05


@given(x=st.floats(-4, 4), z=st.floats(7, 40))
def test_pixels_of_the_frame_and_from_above_are_the_same_ground(x: float, z: float) -> None:
    view = View(ViewSettings(), 1280, 720)
    [[column, row]] = view.to_above(view.to_frame(np.array([x]), np.array([z])))
    assert column == pytest.approx(view.columns(np.array([x]))[0], abs=1e-6)
    assert row == pytest.approx((view.distances[0] - z) * view.along, abs=1e-6)


def test_its_outline_is_the_border_of_what_is_seen(view: View, camera: PinholeCamera) -> None:
    half = len(view.laterals) / 2 / view.across
    corners = [[-half, 0, 42], [half, 0, 42], [half, 0, 6], [-half, 0, 6]]
    assert view.outline == pytest.approx(camera.project(np.array(corners)), abs=0.5)


def test_the_camera_need_not_be_in_the_middle_of_the_lane_that_the_trapezoid_is_laid_on(
    camera: PinholeCamera, settings_for: SettingsFor
) -> None:
    middle = settings_for(camera).view
    shift = 0.5 * camera.focal / camera.width  # half a metre, by the distance
    moved = middle.model_copy(
        update={
            "top_left": middle.top_left - shift / 42,
            "top_right": middle.top_right - shift / 42,
            "bottom_left": middle.bottom_left - shift / 6,
            "bottom_right": middle.bottom_right - shift / 6,
        }
    )
    x, z = np.array([-1.0, 2.0]), np.array([10.0, 30.0])
    views = [View(settings, 1280, 720) for settings in (middle, moved)]
    assert views[0].to_frame(x, z) == pytest.approx(views[1].to_frame(x, z), abs=0.01)


def test_one_settings_fits_frames_of_any_size() -> None:
    x, z = np.array([-1.0, 2.0]), np.array([10.0, 30.0])
    small, large = (View(ViewSettings(), 640 * n, 360 * n).to_frame(x, z) for n in (1, 3))
    assert small * 3 == pytest.approx(large, abs=0.01)
