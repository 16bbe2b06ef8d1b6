"""The real camera's photographs and frames, where they are at hand."""

from itertools import pairwise
from pathlib import Path

import pytest

from vdet.config.lanes import LaneSettings
from vdet.lanes.calibration import Calibration, calibrate
from vdet.lanes.finder import LaneFinder
from vdet.lanes.lane import Lane
from vdet.lanes.undistortion import Undistorter
from vdet.media import VideoReader
from vdet.media.images import read_image

pytestmark = pytest.mark.realdata


@pytest.fixture(scope="module")
def calibration(real_data: Path) -> Calibration:
    return calibrate(sorted((real_data / "camera_cal").glob("*.jpg")), (9, 6))


@pytest.fixture(scope="module")
def undistorter(calibration: Calibration) -> Undistorter:
    return Undistorter(calibration.camera, 1280, 720)


def test_seventeen_of_twenty_boards_are_found_and_one_of_them_spoils_the_fit(
    calibration: Calibration,
) -> None:
    reasons = {skip.photo.stem: skip.reason for skip in calibration.skipped}
    assert sorted(reasons) == ["calibration1", "calibration15", "calibration4", "calibration5"]
    assert "would spoil the fit" in reasons["calibration15"]
    assert len(calibration.views) == 16
    assert {view.size for view in calibration.views} == {(1280, 720), (1281, 721)}


def test_the_real_camera_is_recovered(calibration: Calibration) -> None:
    camera = calibration.camera
    assert (camera.width, camera.height) == (1280, 720)
    assert camera.focal == pytest.approx((1155, 1155), abs=8)
    assert camera.rms < 1.0


def lane_in(undistorter: Undistorter, path: Path) -> Lane:
    finder = LaneFinder(LaneSettings(), 1280, 720)
    lane = finder.find(undistorter.image(read_image(path)))
    assert lane is not None, path.name
    return lane


def test_a_lane_of_the_right_width_is_found_in_every_test_picture(
    undistorter: Undistorter, real_data: Path
) -> None:
    for number in range(1, 7):
        lane = lane_in(undistorter, real_data / "lane_images" / f"test{number}.jpg")
        assert lane.width == pytest.approx(3.7, abs=0.4)
        assert abs(lane.offset) < 0.6
        assert lane.radius is None or lane.radius > 400


def test_straight_roads_are_straight(undistorter: Undistorter, real_data: Path) -> None:
    for number in (1, 2):
        lane = lane_in(undistorter, real_data / "lane_images" / f"straight_lines{number}.jpg")
        assert abs(lane.curvature) < 1 / 3000
        assert lane.width == pytest.approx(3.7, abs=0.2)


def test_the_lane_is_steady_on_pale_concrete(undistorter: Undistorter, real_data: Path) -> None:
    finder = LaneFinder(LaneSettings(), 1280, 720)
    with VideoReader(real_data / "test_video.mp4") as reader:
        lanes = [finder.find(undistorter.image(frame.image)) for frame in reader]
    shown = [lane for lane in lanes if lane]
    assert len(shown) == len(lanes) == 38
    for before, lane in pairwise(shown):
        assert lane.width == pytest.approx(3.7, abs=0.4)
        assert abs(lane.left[0, 0] - before.left[0, 0]) < 25  # pixels; about 12 cm
