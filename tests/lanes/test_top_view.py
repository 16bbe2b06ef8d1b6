"""The top view: ground, rows, columns and pixels agree."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from vdet.config.schema import LaneSettings
from vdet.lanes.top_view import ALONG, TopView
from vdet.synthetic.camera import PinholeCamera

SettingsFor = Callable[[PinholeCamera], LaneSettings]
CAMERA = PinholeCamera.dashboard(1280, 720)


@pytest.fixture
def top_view(settings_for: SettingsFor) -> TopView:
    return TopView(settings_for(CAMERA), CAMERA.width, CAMERA.height)


def test_ground_points_lie_where_the_camera_sees_them(top_view: TopView) -> None:
    x, z = np.array([-1.85, 0, 1.85, 4.0]), np.array([6.0, 20.0, 42.0, 9.0])
    expected = CAMERA.project(np.column_stack([x, np.zeros(4), z]))
    assert top_view.ground_to_frame(x, z) == pytest.approx(expected, abs=0.01)


def test_rows_run_from_far_to_near_and_columns_are_symmetric(top_view: TopView) -> None:
    assert len(top_view.distances) == 36 * 8
    assert top_view.distances[[0, -1]] == pytest.approx([42 - 1 / 16, 6 + 1 / 16], abs=0.01)
    assert len(top_view.laterals) == round(9.7 * 30)
    assert top_view.laterals[0] == pytest.approx(-top_view.laterals[-1])
    assert top_view.columns(top_view.laterals) == pytest.approx(np.arange(len(top_view.laterals)))


@given(x=st.floats(-4, 4), z=st.floats(7, 40))
def test_frame_and_top_view_pixels_show_the_same_ground(x: float, z: float) -> None:
    top_view = TopView(LaneSettings(), 1280, 720)
    [[column, row]] = top_view.frame_to_top(top_view.ground_to_frame(np.array([x]), np.array([z])))
    assert column == pytest.approx(top_view.columns(np.array([x]))[0], abs=1e-6)
    assert row == pytest.approx((top_view.distances[0] - z) * ALONG, abs=1e-6)


def test_the_trapezoid_may_be_measured_away_from_the_middle_of_the_lane(
    settings_for: SettingsFor,
) -> None:
    middle = settings_for(CAMERA)
    shift = 0.5 * CAMERA.focal / CAMERA.width  # half a metre; divide by the distance
    sides = {"top_left": 42, "top_right": 42, "bottom_left": 6, "bottom_right": 6}
    moved = {name: getattr(middle, name) - shift / metres for name, metres in sides.items()}
    x, z = np.array([-1.0, 2.0]), np.array([10.0, 30.0])
    one, other = (
        TopView(settings, 1280, 720).ground_to_frame(x, z)
        for settings in (middle, middle.model_copy(update=moved))
    )
    assert one == pytest.approx(other, abs=0.01)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"top": 0.95}, "bottom must be below top"),
        ({"top_left": 0.6}, "closer together at top"),
        ({"bottom_left": 0.46, "bottom_right": 0.54}, "closer together at top"),
        ({"length": float("nan")}, "finite"),
    ],
)
def test_settings_that_are_not_a_trapezoid_are_refused(
    changes: dict[str, float], message: str
) -> None:
    with pytest.raises(ValidationError, match=message):
        LaneSettings(**(LaneSettings().model_dump() | changes))
