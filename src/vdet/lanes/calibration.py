"""Chessboard photographs → a camera (Zhang 2000, in OpenCV's implementation)."""

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import mode

import cv2
import numpy as np
from pydantic import ValidationError

from vdet.boxes import Float32Array, Image
from vdet.config.scene import LensSettings
from vdet.errors import ImageError
from vdet.media.images import read_image

MIN_PHOTOS = 5
SIZE_TOLERANCE = 2
"""Pixels by which the sides of a photograph may differ from those of the others."""
MAX_SEARCH_PIXELS = 1_300_000
"""A larger photograph is reduced to this size for the search of the board: OpenCV's search takes
minutes on large photographs with grass or gravel."""
OUTLIER_RATIO = 3.0
"""A photograph is dropped if its error is more than this many times the median error."""
MIN_ANGLE = 15.0
"""Degrees by which the boards of at least two photographs must be turned against each other."""

Pattern = tuple[int, int]
"""Number of inner corners of a chessboard, along and across."""


@dataclass(frozen=True, slots=True)
class BoardPhoto:
    """A photograph that shows the whole board."""

    path: Path
    size: tuple[int, int]
    """Width and height, pixels."""
    corners: Float32Array
    """The inner corners of the board, pixels `(n, 2)`, row by row."""


@dataclass(frozen=True, slots=True)
class LensCalibration:
    """A camera, and the photographs that it was fitted to."""

    camera: LensSettings
    rms: float
    """Root mean square distance between the corners in the photographs and the camera's, pixels."""
    photos: list[BoardPhoto]
    skipped: dict[Path, str]
    """The photographs that were not used, each with the reason."""


def calibrate(paths: Iterable[Path], pattern: Pattern) -> LensCalibration:
    """Find the camera that took these photographs of a flat chessboard.

    The frame size is the most frequent size of the photographs. Photographs whose sides differ
    by at most `SIZE_TOLERANCE` pixels are used unchanged, others are skipped. After a first fit,
    photographs with an error above `OUTLIER_RATIO` × the median are dropped, and the others
    are fitted again.

    Raises
    ------
    ImageError
        Fewer than `MIN_PHOTOS` photographs can be used, or all show the board from one side.
    """
    boards = {path: _find_board(path, pattern) for path in paths}
    skipped = {path: board for path, board in boards.items() if isinstance(board, str)}
    photos = [board for board in boards.values() if isinstance(board, BoardPhoto)]
    size = mode(photo.size for photo in photos) if photos else (0, 0)
    for photo in photos:
        if np.abs(np.subtract(photo.size, size)).max() > SIZE_TOLERANCE:
            skipped[photo.path] = f"is {_size_text(photo.size)}, the others are {_size_text(size)}"
    photos = _without(skipped, photos, pattern)
    camera, errors = _fit(photos, pattern, size)
    median = float(np.median(errors))
    for photo, error in zip(photos, errors, strict=True):
        if error > OUTLIER_RATIO * median:
            skipped[photo.path] = f"is an outlier: error {error:.2f} px, median {median:.2f} px"
    used = _without(skipped, photos, pattern)
    if len(used) < len(photos):
        camera, errors = _fit(used, pattern, size)
    if camera is None:
        raise ImageError(
            "cannot compute the focal length: all photographs show the board from nearly the same "
            f"angle; take some with the board tilted by {MIN_ANGLE:.0f}° or more, left and "
            "right, up and down"
        )
    return LensCalibration(camera, float(np.sqrt(np.mean(np.square(errors)))), used, skipped)


def find_corners(image: Image, pattern: Pattern) -> Float32Array | None:
    """Return the inner corners of a board to sub-pixel accuracy, `(n, 2)`; None without a board."""
    gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    scale = min(1.0, math.sqrt(MAX_SEARCH_PIXELS / gray.size))
    small = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    has_board, corners = cv2.findChessboardCorners(small, pattern)
    if not has_board:
        return None
    corners = np.asarray((corners + 0.5) / scale - 0.5, np.float32)
    points = corners.reshape(pattern[1], pattern[0], 2)
    square = float(np.linalg.norm(np.diff(points, axis=1), axis=2).min())
    half = int(np.clip(square / 3, 2, 11 / scale))  # the window must not reach the next corner
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 0.005)
    refined = cv2.cornerSubPix(gray, corners, (half, half), (-1, -1), stop)
    return np.asarray(refined, np.float32).reshape(-1, 2)


def _find_board(path: Path, pattern: Pattern) -> BoardPhoto | str:
    """Find the board in a photograph; return the reason if the photograph cannot be used."""
    try:
        image = read_image(path)
    except ImageError as error:
        return str(error).removeprefix(f"{path}: ")
    corners = find_corners(image, pattern)
    if corners is None:
        return f"no board of {_size_text(pattern)} inner corners found"
    return BoardPhoto(path, (image.shape[1], image.shape[0]), corners)


def _without(
    skipped: Mapping[Path, str], photos: Sequence[BoardPhoto], pattern: Pattern
) -> list[BoardPhoto]:
    """Return the photographs that are not skipped; raise an error if too few are left."""
    kept = [photo for photo in photos if photo.path not in skipped]
    if len(kept) < MIN_PHOTOS:
        raise ImageError(
            f"only {len(kept)} of {len(kept) + len(skipped)} photographs can be used, at least "
            f"{MIN_PHOTOS} are needed; take more of the whole board from different angles, or "
            f"use another --pattern than {_size_text(pattern)}"
        )
    return kept


def _fit(
    photos: Sequence[BoardPhoto], pattern: Pattern, size: tuple[int, int]
) -> tuple[LensSettings | None, list[float]]:
    """Fit a camera to the corners of all photographs; return it and each photograph's error.

    There is no camera if all boards are seen from one side: any focal length fits those. An error
    is the root mean square distance of the corners to the model's, pixels.
    """
    board = np.zeros((pattern[0] * pattern[1], 3), np.float32)  # a square is 1 unit long
    board[:, :2] = np.mgrid[: pattern[0], : pattern[1]].T.reshape(-1, 2)
    corners = [photo.corners for photo in photos]
    _, matrix, distortion, rotations, *_, errors = cv2.calibrateCameraExtended(
        [board] * len(photos), corners, size, np.eye(3), np.zeros(5)
    )
    normals = np.array([cv2.Rodrigues(np.asarray(rotation))[0][:, 2] for rotation in rotations])
    (fx, _, x), (_, fy, y), _ = matrix.tolist()
    width, height = size
    is_real = 0.1 * width <= min(fx, fy) and max(fx, fy) <= 100 * width
    in_frame = 0 <= x < width and 0 <= y < height
    has_angles = np.clip(normals @ normals.T, -1, 1).min() <= math.cos(math.radians(MIN_ANGLE))
    camera = None
    if has_angles and is_real and in_frame:
        k1, k2, p1, p2, k3 = np.ravel(distortion).tolist()
        with suppress(ValidationError):  # no real camera has such values
            camera = LensSettings(
                size=size, matrix=matrix.tolist(), distortion=(k1, k2, p1, p2, k3)
            )
    return camera, np.ravel(errors).tolist()


def _size_text(size: Iterable[int]) -> str:
    return "×".join(map(str, size))
