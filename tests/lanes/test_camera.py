"""A calibrated camera, its file, and the undistortion of frames and boxes."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from lanes.chessboards import CAMERA
from vdet.boxes import Box
from vdet.config.loading import load_settings
from vdet.config.scene import LensSettings
from vdet.errors import ConfigError
from vdet.lanes.camera import Undistorter, save_camera

MATRIX = CAMERA.matrix


@pytest.fixture(scope="module")
def undistorter() -> Undistorter:
    return Undistorter(CAMERA, 640, 480)


PLAIN = CAMERA.model_copy(update={"distortion": (0, 0, 0, 0, 0)})


def test_a_frame_of_twice_the_size_is_undistorted_in_the_same_way(undistorter: Undistorter) -> None:
    assert CAMERA.matrix_for(640, 480) == MATRIX
    doubled = [[1120, 0, 644.5], [0, 1116, 472.5], [0, 0, 1]]  # scaled about the frame's corner
    assert np.array(CAMERA.matrix_for(1280, 960)).tolist() == doubled
    small = undistorter.points(np.array([[100.0, 80.0]]))
    large = Undistorter(CAMERA, 1280, 960).points(np.array([[200.5, 160.5]]))
    assert (large + 0.5) / 2 - 0.5 == pytest.approx(small)


def test_an_aspect_ratio_may_differ_by_rounding_only() -> None:
    matrix = ((1150, 0, 640), (0, 1150, 360), (0, 0, 1))
    camera = LensSettings(size=(1280, 720), matrix=matrix, distortion=(0, 0, 0, 0, 0))
    assert camera.matrix_for(854, 480)[0][0] == pytest.approx(767, abs=1)
    for size in ((640, 480), (720, 1280), (1320, 720)):
        with pytest.raises(ConfigError, match=r"is for 1280×720, not"):
            Undistorter(camera, *size)


def test_lines_bent_by_the_lens_become_straight(undistorter: Undistorter) -> None:
    matrix = np.array(MATRIX)
    for row in (20.0, 460.0):
        ideal = np.column_stack([np.linspace(60, 580, 30), np.full(30, row), np.ones(30)])
        rays = ideal @ np.linalg.inv(matrix).T
        seen, _ = cv2.projectPoints(
            rays, np.zeros(3), np.zeros(3), matrix, np.array(CAMERA.distortion)
        )
        image = np.zeros((480, 640, 3), np.uint8)
        points = np.rint(seen[:, 0] * 16).astype(np.int32)
        cv2.polylines(image, [points], False, (255, 255, 255), 3, cv2.LINE_AA, 4)
        line = undistorter.image(image)[..., 0].astype(float)
        rows = (line[:, 70:570] * np.arange(480)[:, None]).sum(axis=0) / line[:, 70:570].sum(axis=0)
        assert np.ptp(seen[:, 0, 1]) > 8
        assert np.abs(rows - row).max() < 1


def test_a_box_is_clipped_to_the_frame(undistorter: Undistorter) -> None:
    assert undistorter.box(Box.sized(0, 0, 640, 480)) == Box.sized(0, 0, 640, 480)
    assert undistorter.box(Box.sized(0, 0, 12, 12)).area == 0


@pytest.mark.parametrize("camera", [None, PLAIN])
def test_without_distortion_nothing_changes(camera: LensSettings | None) -> None:
    undistorter = Undistorter(camera, 640, 480)
    image = np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    assert (undistorter.image(image) == image).all()
    assert undistorter.box(Box.sized(3, 5, 20, 10)) == Box.sized(3, 5, 20, 10)
    assert undistorter.points(np.array([[3.0, 5.0]])) == pytest.approx(np.array([[3.0, 5.0]]))


def test_a_camera_is_read_with_all_its_digits(tmp_path: Path) -> None:
    camera = CAMERA.model_copy(update={"distortion": (-1 / 3, 0.1, 1e-9, -7 / 11, 0.0)})
    save_camera(camera, tmp_path / "camera.yaml")
    assert load_settings([tmp_path / "camera.yaml"]).camera.lens == camera
