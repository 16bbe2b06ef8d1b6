"""Calibration with photographs drawn for a known camera."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from lanes.chessboards import PATTERN, photographs
from vdet.errors import ImageError
from vdet.lanes.calibration import Calibration, calibrate, find_corners
from vdet.lanes.camera import CalibratedCamera
from vdet.media.images import write_image


@pytest.fixture(scope="module")
def true_camera() -> CalibratedCamera:
    return CalibratedCamera(
        640, 480, (560.0, 558.0), (322.0, 236.0), (-0.25, 0.06, 0.0005, -0.0004, 0), 0
    )


@pytest.fixture(scope="module")
def photos(true_camera: CalibratedCamera, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("boards")
    paths = []
    for number, image in enumerate(photographs(true_camera)):
        paths.append(folder / f"board{number}.png")
        write_image(paths[-1], image)
    return paths


@pytest.fixture(scope="module")
def calibration(photos: list[Path]) -> Calibration:
    return calibrate(photos, PATTERN)


def test_focal_length_and_principal_point_are_recovered(
    calibration: Calibration, true_camera: CalibratedCamera
) -> None:
    camera = calibration.camera
    assert (camera.width, camera.height) == (640, 480)
    assert camera.focal == pytest.approx(true_camera.focal, rel=0.01)
    assert camera.center == pytest.approx(true_camera.center, abs=4)
    assert camera.rms < 0.2
    assert len(calibration.photos) == len(calibration.errors) == 8
    assert calibration.skipped == ()


def test_corners_are_found_to_a_fraction_of_a_pixel(true_camera: CalibratedCamera) -> None:
    front = photographs(true_camera, 1)[0]
    corners = find_corners(front, PATTERN)
    assert corners is not None
    board = np.zeros((54, 3))
    board[:, :2] = np.mgrid[:9, :6].T.reshape(-1, 2) - (4, 2.5)
    shift = np.array([0, 0, 13.0])
    distortion = np.array(true_camera.distortion)
    expected, _ = cv2.projectPoints(board, np.zeros(3), shift, true_camera.matrix, distortion)
    assert np.abs(corners - expected[:, 0]).max() < 0.15


def test_a_photograph_without_a_board_is_skipped_with_a_reason(
    photos: list[Path], tmp_path: Path
) -> None:
    blank = tmp_path / "wall.png"
    write_image(blank, np.full((480, 640, 3), 99, np.uint8))
    broken = tmp_path / "broken.png"
    broken.write_bytes(b"no picture")
    skipped = calibrate([*photos[:5], blank, broken], PATTERN).skipped
    assert [photo.path for photo in skipped] == [blank, broken]
    assert skipped[0].reason == "no board of 9×6 inner corners is seen"
    assert skipped[1].reason.startswith("is not a picture")


def test_a_photograph_of_another_size_is_skipped_with_a_reason(
    photos: list[Path], tmp_path: Path
) -> None:
    image = cv2.imread(str(photos[0]))
    assert image is not None
    large = tmp_path / "large.png"
    write_image(large, np.asarray(cv2.resize(image, (960, 720)), np.uint8))
    skipped = calibrate([*photos[1:], large], PATTERN).skipped
    assert [(photo.path, photo.reason) for photo in skipped] == [
        (large, "is 960×720, the others are 640×480")
    ]


def test_an_outlier_is_dropped_with_a_reason(
    photos: list[Path], true_camera: CalibratedCamera, tmp_path: Path
) -> None:
    image = cv2.imread(str(photos[3]))
    assert image is not None
    rows, columns = np.indices((480, 640), dtype=np.float32)
    waves = columns + 3 * np.sin(rows / 20, dtype=np.float32)
    bent = tmp_path / "bent.png"  # of a board that is not flat
    write_image(bent, np.asarray(cv2.remap(image, waves, rows, cv2.INTER_LINEAR), np.uint8))
    found = calibrate([*photos, bent], PATTERN)
    assert [photo.path for photo in found.skipped] == [bent]
    assert "is an outlier" in found.skipped[0].reason
    assert found.camera.focal == pytest.approx(true_camera.focal, rel=0.01)


def test_fewer_than_five_photographs_are_refused(photos: list[Path]) -> None:
    with pytest.raises(ImageError, match=r"only 4 of 4 photographs .* at least 5 are needed"):
        calibrate(photos[:4], PATTERN)


def test_boards_that_are_all_seen_from_the_front_are_refused(
    true_camera: CalibratedCamera, tmp_path: Path
) -> None:
    front = photographs(true_camera, 1)[0]
    same = []
    for number in range(5):
        same.append(tmp_path / f"{number}.png")
        moved = np.array([[1, 0, 4.0 * number], [0, 1, 3.0 * number]])
        image = cv2.warpAffine(front, moved, (640, 480), borderMode=cv2.BORDER_REPLICATE)
        write_image(same[-1], np.asarray(image, np.uint8))
    with pytest.raises(ImageError, match=r"much the same side .* take some with the board slanted"):
        calibrate(same, PATTERN)
