"""The lane, found in the same stream of frames as the vehicles."""

import pytest

from red_cars import HEIGHT, SETTINGS, WIDTH, drive
from run.red_runs import follow
from vdet.config.scene import CameraSettings, LensSettings
from vdet.config.schema import LaneSettings
from vdet.lanes.camera import Undistorter

LENS = LensSettings(
    size=(WIDTH, HEIGHT),
    matrix=((240, 0, 160), (0, 240, 120), (0, 0, 1)),
    distortion=(-0.35, 0.1, 0.0, 0.0, 0.0),
)
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
