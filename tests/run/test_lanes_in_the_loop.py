"""The lane, found in the same stream of frames as the vehicles."""

import pytest

from red_cars import HEIGHT, WIDTH, drive
from run.red_runs import follow
from vdet.config.camera import LensSettings
from vdet.lanes.camera import Undistorter
from vdet.lanes.road import LaneRequest

LENS = LensSettings(
    WIDTH, HEIGHT, ((240, 0, 160), (0, 240, 120), (0, 0, 1)), (-0.35, 0.1, 0.0, 0.0, 0.0), 0.4
)
COUNT = 10


def test_vehicles_are_searched_in_the_original_frame() -> None:
    with_lanes = follow(drive(15), lanes=LaneRequest(LENS))
    without = follow(drive(15))
    for one, other in zip(with_lanes, without, strict=True):
        assert one.tracks == other.tracks
        assert (one.frame.image == other.frame.image).all()


def test_no_whole_frame_is_undistorted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(Undistorter, "image")
    assert all(result.road for result in follow(drive(COUNT), lanes=LaneRequest(LENS)))
