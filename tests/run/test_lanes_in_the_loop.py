"""The lane, found in the same stream of frames as the vehicles."""

import pytest

from red_cars import SETTINGS, drive
from run.red_runs import follow
from run.sinks.test_overlay import LENS
from vdet.config.scene import CameraSettings
from vdet.config.schema import LaneSettings
from vdet.lanes.camera import Undistorter

WITH_LANES = SETTINGS.model_copy(
    update={"camera": CameraSettings(lens=LENS), "lanes": LaneSettings(enabled=True)}
)
COUNT = 10


def test_vehicles_are_searched_in_the_original_frame() -> None:
    with_lanes = follow(drive(15), WITH_LANES)
    without = follow(drive(15))
    for one, other in zip(with_lanes, without, strict=True):
        assert one.tracks == other.tracks
        assert (one.frame.image == other.frame.image).all()


def test_no_whole_frame_is_undistorted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(Undistorter, "image")
    assert all(result.road for result in follow(drive(COUNT), WITH_LANES))
