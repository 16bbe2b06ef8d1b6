"""Tests of what a track tells of a vehicle."""

import pytest

from vdet.boxes import Box
from vdet.track.track import Track


def test_a_vehicle_stands_at_the_middle_of_the_lower_edge_of_its_box() -> None:
    track = Track(1, Box.sized(10, 20, 30, 40), 0.9, predicted=False)
    assert track.foot == pytest.approx((25, 60))


def test_the_foot_of_the_whole_vehicle_may_lie_outside_the_shown_box() -> None:
    track = Track(1, Box.sized(0, 20, 30, 40), 0.9, predicted=False, whole_foot=(-5.0, 60.0))
    assert track.foot == (-5.0, 60.0)
