"""The JSON form of a lane."""

from dataclasses import replace

import numpy as np

from vdet.lanes.lane import Lane, lane_record

LANE = Lane(
    curvature=-1 / 812.34567,
    radius=812.34567,
    offset=-0.12345,
    width=3.70049,
    left=np.array([[100.04, 400.06], [200.0, 300.0]]),
    right=np.array([[500.123, 400.0], [400.96, 300.0]]),
)


def test_metres_are_rounded_to_millimetres_and_pixels_to_tenths() -> None:
    assert lane_record(LANE) == {
        "radius": 812.346,
        "offset": -0.123,
        "width": 3.7,
        "left": [[100.0, 400.1], [200.0, 300.0]],
        "right": [[500.1, 400.0], [401.0, 300.0]],
    }


def test_a_straight_road_has_no_radius() -> None:
    record = lane_record(replace(LANE, radius=None))
    assert record is not None
    assert record["radius"] is None


def test_no_lane_has_no_record() -> None:
    assert lane_record(None) is None
