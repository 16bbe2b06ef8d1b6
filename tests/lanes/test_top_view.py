"""The top view: ground, rows, columns and pixels agree."""

from collections.abc import Callable

import numpy as np
import pytest
from pydantic import ValidationError

from vdet.config.schema import LaneSettings
from vdet.lanes.camera import TopView
from vdet.synthetic.camera import PinholeCamera

SettingsFor = Callable[[PinholeCamera], LaneSettings]
CAMERA = PinholeCamera.dashboard(1280, 720)


@pytest.fixture
def top_view(settings_for: SettingsFor) -> TopView:
    return TopView(settings_for(CAMERA), CAMERA.width, CAMERA.height)


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
