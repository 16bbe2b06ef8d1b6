"""The top view: ground, rows, columns and pixels agree."""

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from lanes.roads import settings_for
from vdet.config.schema import LaneSettings
from vdet.lanes.camera import TopView
from vdet.synthetic import PinholeCamera

CAMERA = PinholeCamera.dashboard(1280, 720)


def test_the_trapezoid_may_be_measured_away_from_the_middle_of_the_lane() -> None:
    middle = settings_for(CAMERA)
    shift = 0.5 * CAMERA.focal / CAMERA.width  # half a metre; divide by the distance
    corners = zip(middle.points, (6, 6, 42, 42), strict=True)
    moved = tuple((x - shift / metres, y) for (x, y), metres in corners)
    x, z = np.array([-1.0, 2.0]), np.array([10.0, 30.0])
    one, other = (
        TopView(settings, 1280, 720).ground_to_frame(x, z)
        for settings in (middle, middle.model_copy(update={"points": moved}))
    )
    assert one == pytest.approx(other, abs=0.01)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": [(0.2, 0.6), (0.8, 0.6), (0.5, 0.9), (0.4, 0.9)]}, "two in a near row"),
        ({"points": [(0.2, 0.9), (0.8, 0.8), (0.5, 0.6), (0.4, 0.6)]}, "two in a near row"),
        ({"points": [(0.2, 0.9), (0.8, 0.9), (0.4, 0.6), (0.5, 0.6)]}, "closer together"),
        ({"points": [(0.4, 0.9), (0.5, 0.9), (0.5, 0.6), (0.4, 0.6)]}, "closer together"),
        ({"metres": (3.7, float("nan"))}, "finite"),
    ],
)
def test_settings_that_are_not_a_trapezoid_are_refused(changes: Any, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        LaneSettings(**changes)
