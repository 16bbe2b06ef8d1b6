"""Drawn photographs of a flat chessboard, as a camera with known lens would take them."""

import cv2
import numpy as np

from vdet.boxes import Image
from vdet.config.scene import LensSettings

CAMERA = LensSettings(
    size=(640, 480),
    matrix=((560.0, 0.0, 322.0), (0.0, 558.0, 236.0), (0.0, 0.0, 1.0)),
    distortion=(-0.25, 0.06, 0.0005, -0.0004, 0.0),
)
"""A camera with visible lens distortion."""
PATTERN = (9, 6)
_TEXELS = 40  # side of a square of the board, texels
_POSES = (
    (0.0, 0.0, 0.0, 0.0, 0.0, 13.0), (0.5, 0.0, 0.05, -1.5, 0.5, 13.0),
    (-0.5, 0.2, 0.0, 1.5, -0.5, 14.0), (0.1, 0.6, -0.05, 1.5, 1.0, 13.0),
    (0.0, -0.6, 0.1, -1.5, -1.0, 13.0), (0.4, 0.4, 0.1, 0.0, 1.5, 15.0),
    (-0.4, -0.4, 0.3, 2.0, 0.0, 15.0), (0.35, -0.45, -0.3, -2.0, 0.0, 16.0),
)  # fmt: skip


def photographs(camera: LensSettings, number: int = len(_POSES)) -> list[Image]:
    """Draw the board, 9 × 6 inner corners, in different poses."""
    return [_photograph(camera, np.array(pose)) for pose in _POSES[:number]]


def _photograph(camera: LensSettings, pose: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Image:
    """Look up where the ray of each pixel meets the board; the unit of length is a square."""
    rotation, _ = cv2.Rodrigues(pose[:3])
    middle = np.array([(PATTERN[0] - 1) / 2, (PATTERN[1] - 1) / 2, 0])
    shift = pose[3:] - rotation @ middle
    to_board = np.linalg.inv(np.column_stack([rotation[:, 0], rotation[:, 1], shift]))
    columns, rows = np.meshgrid(*map(np.arange, camera.size))
    pixels = np.stack([columns.ravel(), rows.ravel()], axis=1).astype(np.float64)
    rays = cv2.undistortPoints(
        pixels[:, None], np.array(camera.matrix), np.array(camera.distortion)
    )[:, 0]
    board = np.column_stack([rays, np.ones(len(rays))]) @ to_board.T
    places = (board[:, :2] / board[:, 2:] + 2) * _TEXELS - 0.5
    x, y = (places[:, i].reshape(*camera.size[::-1]).astype(np.float32) for i in (0, 1))
    drawn = cv2.remap(_board(), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(
        cv2.cvtColor(cv2.GaussianBlur(drawn, (3, 3), 0.7), cv2.COLOR_GRAY2BGR), np.uint8
    )


def _board() -> Image:
    """Draw the board from the front with a white margin; its first corner is at (2, 2)."""
    squares = np.full((PATTERN[1] + 3, PATTERN[0] + 3), 230, np.uint8)
    rows, columns = np.indices((PATTERN[1] + 1, PATTERN[0] + 1))
    squares[1:-1, 1:-1][(rows + columns) % 2 == 0] = 25
    return np.kron(squares, np.ones((_TEXELS, _TEXELS), np.uint8))
