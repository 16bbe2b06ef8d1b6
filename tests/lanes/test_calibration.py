"""Calibration with photographs drawn for a known camera."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from lanes.chessboards import CAMERA, PATTERN, photographs
from vdet.config.scene import LensSettings
from vdet.errors import ImageError
from vdet.lanes.camera import Undistorter, calibrate, find_corners
from vdet.media.images import read_image
from writing import write_image

LARGE = LensSettings(
    size=(2560, 1920),
    matrix=((2240, 0, 1289.5), (0, 2232, 945.5), (0, 0, 1)),
    distortion=(0, 0, 0, 0, 0),
)


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("boards")
    return [
        written(image, folder / f"board{number}.png")
        for number, image in enumerate(photographs(CAMERA))
    ]


def written(image: npt.NDArray[Any], path: Path) -> Path:
    write_image(path, np.asarray(image, np.uint8))
    return path


def test_the_camera_is_recovered(photos: list[Path]) -> None:
    calibration = calibrate(photos, PATTERN)
    camera = calibration.camera
    assert camera.size == (640, 480)
    for row, truth in zip(camera.matrix, CAMERA.matrix, strict=True):
        assert row == pytest.approx(truth, abs=5)
    assert calibration.rms < 0.2
    assert [photo.path for photo in calibration.photos] == photos
    assert calibration.skipped == {}
    pixels = np.mgrid[40:620:8j, 40:450:8j].reshape(2, -1).T
    found, true = (Undistorter(item, 640, 480).points(pixels) for item in (camera, CAMERA))
    assert np.abs(found - true).max() < 2.5


@pytest.mark.parametrize("camera", [CAMERA, LARGE])
def test_corners_are_found_to_a_fraction_of_a_pixel(camera: LensSettings) -> None:
    corners = find_corners(photographs(camera, 1)[0], PATTERN)
    assert corners is not None
    board = np.zeros((54, 3))
    board[:, :2] = np.mgrid[:9, :6].T.reshape(-1, 2) - (4, 2.5)
    matrix, distortion = np.array(camera.matrix), np.array(camera.distortion)
    shift = np.array([0, 0, 13.0])
    expected, _ = cv2.projectPoints(board, np.zeros(3), shift, matrix, distortion)
    assert np.abs(corners - expected[:, 0]).max() < 0.15


def test_photographs_that_cannot_be_used_are_skipped_with_a_reason(
    photos: list[Path], tmp_path: Path
) -> None:
    blank = written(np.full((480, 640, 3), 99, np.uint8), tmp_path / "wall.png")
    broken = tmp_path / "broken.png"
    broken.write_bytes(b"no picture")
    large = written(cv2.resize(read_image(photos[0]), (960, 720)), tmp_path / "large.png")
    skipped = calibrate([*photos[1:7], blank, broken, large], PATTERN).skipped
    assert skipped.pop(broken).startswith("is not an image")
    assert skipped == {
        blank: "no board of 9×6 inner corners found",
        large: "is 960×720, the others are 640×480",
    }


def test_an_outlier_is_dropped_with_a_reason(photos: list[Path], tmp_path: Path) -> None:
    rows, columns = np.indices((480, 640), dtype=np.float32)
    waves = columns + 3 * np.sin(rows / 20, dtype=np.float32)
    image = cv2.remap(read_image(photos[3]), waves, rows, cv2.INTER_LINEAR)
    bent = written(image, tmp_path / "bent.png")  # the board is not flat
    found = calibrate([*photos, bent], PATTERN)
    assert list(found.skipped) == [bent]
    assert "is an outlier" in found.skipped[bent]
    assert found.rms < 0.2


def test_too_few_photographs_with_a_board_are_refused(photos: list[Path]) -> None:
    with pytest.raises(ImageError, match=r"only 4 of 4 photographs .* at least 5 are needed"):
        calibrate(photos[:4], PATTERN)
    with pytest.raises(ImageError, match=r"only 0 of 2 .* another --pattern than 8×4"):
        calibrate(photos[:2], (8, 4))


def test_boards_that_are_all_seen_from_the_front_are_refused(tmp_path: Path) -> None:
    front = photographs(CAMERA, 1)[0]
    same = []
    for number in range(5):
        moved = np.array([[1, 0, 4.0 * number], [0, 1, 3.0 * number]])
        image = cv2.warpAffine(front, moved, (640, 480), borderMode=cv2.BORDER_REPLICATE)
        same.append(written(image, tmp_path / f"{number}.png"))
    with pytest.raises(ImageError, match=r"nearly the same angle; take some with the board tilted"):
        calibrate(same, PATTERN)
