"""Calibration and lanes on the real data set."""

from itertools import pairwise
from pathlib import Path

import pytest

from vdet.config.loading import find_config, load_settings
from vdet.lanes.camera import LensCalibration, calibrate
from vdet.lanes.road import Lane, RoadFinder
from vdet.media import Picture
from vdet.media.images import read_image
from vdet.media.reader import VideoReader

PROJECT_LANE = load_settings([find_config("project-camera")]).lanes

pytestmark = pytest.mark.realdata


@pytest.fixture(scope="module")
def calibration(real_data: Path) -> LensCalibration:
    return calibrate(sorted((real_data / "camera_cal").glob("*.jpg")), (9, 6))


def test_seventeen_of_twenty_boards_are_found_and_one_of_them_is_an_outlier(
    calibration: LensCalibration,
) -> None:
    reasons = {path.stem: reason for path, reason in calibration.skipped.items()}
    assert sorted(reasons) == ["calibration1", "calibration15", "calibration4", "calibration5"]
    assert "is an outlier" in reasons["calibration15"]
    assert len(calibration.photos) == 16
    assert {photo.size for photo in calibration.photos} == {(1280, 720), (1281, 721)}


def test_the_real_camera_is_recovered(calibration: LensCalibration) -> None:
    camera = calibration.camera
    assert camera.size == (1280, 720)
    assert camera.matrix[0][0] == pytest.approx(1155, abs=8)
    assert camera.matrix[1][1] == pytest.approx(1155, abs=8)
    assert calibration.rms < 1.0


def finder_of(calibration: LensCalibration) -> RoadFinder:
    return RoadFinder(calibration.camera, PROJECT_LANE, 1280, 720)


def lane_in(calibration: LensCalibration, path: Path) -> Lane:
    finder = finder_of(calibration)
    lane = finder.update(finder.observe(Picture(read_image(path)))).lane
    assert lane is not None, path.name
    return lane


def test_a_lane_of_the_right_width_is_found_in_every_test_picture(
    calibration: LensCalibration, real_data: Path
) -> None:
    for number in range(1, 7):
        lane = lane_in(calibration, real_data / "lane_images" / f"test{number}.jpg")
        assert lane.width == pytest.approx(3.7, abs=0.4)
        assert lane.offset == pytest.approx(0, abs=0.6)
        assert lane.radius is None or lane.radius > 400


def test_the_lane_is_steady_on_pale_concrete(calibration: LensCalibration, real_data: Path) -> None:
    finder = finder_of(calibration)
    with VideoReader(real_data / "test_video.mp4") as reader:
        lanes = [finder.update(finder.observe(frame.picture)).lane for frame in reader]
    shown = [lane for lane in lanes if lane]
    assert len(shown) == len(lanes) == 38
    for before, lane in pairwise(shown):
        assert lane.width == pytest.approx(3.7, abs=0.4)
        assert abs(lane.left[0, 0] - before.left[0, 0]) < 25  # pixels; about 12 cm
