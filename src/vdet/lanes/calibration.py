"""Chessboard photographs → a camera (Zhang 2000, in OpenCV's implementation).

`calibrate` fits the camera. `write_previews` makes pictures to judge the fit by: the corners that
were found, and whether straight lines become straight.
"""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import Float32Array, Float64Array
from vdet.errors import ImageError, OutputError
from vdet.files import check_output, make_folder
from vdet.lanes.camera import CalibratedCamera, Undistorter
from vdet.media.images import Image, read_image, write_image

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
class SkippedPhoto:
    """A photograph that was not used, and the reason."""

    path: Path
    reason: str


@dataclass(frozen=True, slots=True)
class Calibration:
    """A camera, and the photographs that it was fitted to."""

    camera: CalibratedCamera
    photos: tuple[BoardPhoto, ...]
    errors: tuple[float, ...]
    """Root mean square distance of the corners to the model's, pixels, for each of `photos`."""
    skipped: tuple[SkippedPhoto, ...]


def calibrate(paths: Iterable[Path], pattern: Pattern) -> Calibration:
    """Find the camera that took these photographs of a flat chessboard.

    The frame size is the most frequent size of the photographs. Photographs whose sides differ
    by at most `SIZE_TOLERANCE` pixels are used unchanged, others are skipped. After a first fit,
    photographs with an error above `OUTLIER_RATIO` × the median are dropped, and the rest is
    fitted again.

    Raises
    ------
    ImageError
        Fewer than `MIN_PHOTOS` photographs can be used, or all show the board from one side.
    """
    photos, skipped = _find_boards(paths, pattern)
    photos, odd = _of_one_size(photos)
    skipped += odd
    _check_number(photos, skipped, pattern)
    fit = _fit(photos, pattern)
    if outliers := _outliers(photos, fit.errors):
        skipped += outliers
        dropped = {outlier.path for outlier in outliers}
        photos = [photo for photo in photos if photo.path not in dropped]
        _check_number(photos, skipped, pattern)
        fit = _fit(photos, pattern)
    _check_fit(fit)
    return Calibration(fit.camera, tuple(photos), fit.errors, tuple(skipped))


def find_corners(image: Image, pattern: Pattern) -> Float32Array | None:
    """Return the inner corners of a board to a fraction of a pixel, `(n, 2)`; None without one."""
    gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    scale = min(1.0, math.sqrt(MAX_SEARCH_PIXELS / gray.size))
    method = cv2.INTER_AREA
    small = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=method) if scale < 1 else gray
    found, corners = cv2.findChessboardCorners(small, pattern)
    if not found:
        return None
    corners = np.asarray((corners + 0.5) / scale - 0.5, np.float32)
    points = corners.reshape(pattern[1], pattern[0], 2)
    square = float(np.linalg.norm(np.diff(points, axis=1), axis=2).min())
    half = int(np.clip(square / 3, 2, 11 / scale))  # the window must not reach the next corner
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 0.005)
    refined = cv2.cornerSubPix(gray, corners, (half, half), (-1, -1), stop)
    return np.asarray(refined, np.float32).reshape(-1, 2)


def check_previews(folder: Path, paths: Sequence[Path], *, overwrite: bool) -> None:
    """Make the folder, and refuse pictures that could not be written. Raises `OutputError`."""
    make_folder(folder)
    pictures = [_preview_of(path, folder) for path in paths]
    for picture in pictures:
        if pictures.count(picture) > 1:
            raise OutputError(f"{picture}: wanted by two photographs of one name; rename one")
        check_output(picture, overwrite=overwrite, inputs=paths)


def write_previews(
    folder: Path, calibration: Calibration, pattern: Pattern, *, overwrite: bool = False
) -> None:
    """Write each used photograph with its corners, as it is and undistorted, side by side."""
    for photo in calibration.photos:
        image = read_image(photo.path)
        undistorter = Undistorter(calibration.camera, *photo.size)
        cv2.drawChessboardCorners(image, pattern, photo.corners[:, None], True)
        both = np.hstack([image, undistorter.image(image)])
        write_image(_preview_of(photo.path, folder), both, overwrite=overwrite)


def _preview_of(path: Path, folder: Path) -> Path:
    return folder / f"{path.stem}.jpg"


def _find_boards(
    paths: Iterable[Path], pattern: Pattern
) -> tuple[list[BoardPhoto], list[SkippedPhoto]]:
    photos, skipped = [], []
    for path in paths:
        try:
            image = read_image(path)
        except ImageError as error:
            skipped.append(SkippedPhoto(path, str(error).removeprefix(f"{path}: ")))
            continue
        corners = find_corners(image, pattern)
        if corners is None:
            reason = f"no board of {_text(pattern)} inner corners is seen"
            skipped.append(SkippedPhoto(path, reason))
        else:
            photos.append(BoardPhoto(path, (image.shape[1], image.shape[0]), corners))
    return photos, skipped


def _of_one_size(photos: list[BoardPhoto]) -> tuple[list[BoardPhoto], list[SkippedPhoto]]:
    if not photos:
        return [], []
    width, height = _common_size(photos)
    same, odd = [], []
    for photo in photos:
        if max(abs(photo.size[0] - width), abs(photo.size[1] - height)) <= SIZE_TOLERANCE:
            same.append(photo)
        else:
            reason = f"is {photo.size[0]}×{photo.size[1]}, the others are {width}×{height}"
            odd.append(SkippedPhoto(photo.path, reason))
    return same, odd


def _common_size(photos: Iterable[BoardPhoto]) -> tuple[int, int]:
    return Counter(photo.size for photo in photos).most_common(1)[0][0]


def _check_number(photos: list[BoardPhoto], skipped: list[SkippedPhoto], pattern: Pattern) -> None:
    if len(photos) < MIN_PHOTOS:
        raise ImageError(
            f"only {len(photos)} of {len(photos) + len(skipped)} photographs can be used, at least "
            f"{MIN_PHOTOS} are needed; take more of the whole board from different sides, or "
            f"give another --pattern than {_text(pattern)}"
        )


@dataclass(frozen=True, slots=True)
class _Fit:
    camera: CalibratedCamera
    errors: tuple[float, ...]
    angle: float
    """The largest angle between the boards of two photographs, degrees."""


def _check_fit(fit: _Fit) -> None:
    """Refuse boards that are all seen from one side: these fit cameras of any focal length."""
    if fit.angle < MIN_ANGLE or fit.camera.problem:
        raise ImageError(
            "the focal length cannot be found: all photographs show the board from much the same "
            f"side (they differ by {fit.angle:.0f}°, {MIN_ANGLE:.0f}° are needed); take some with "
            "the board slanted, to the left and to the right, up and down"
        )


def _fit(photos: list[BoardPhoto], pattern: Pattern) -> _Fit:
    """Fit a camera to the corners of all photographs; a square of the board is 1 unit long."""
    board = np.zeros((pattern[0] * pattern[1], 3), np.float32)
    board[:, :2] = np.mgrid[: pattern[0], : pattern[1]].T.reshape(-1, 2)
    size = _common_size(photos)
    rms, matrix, distortion, rotations, *_, errors = cv2.calibrateCameraExtended(
        [board] * len(photos), [photo.corners for photo in photos], size, np.eye(3), np.zeros(5)
    )
    (fx, _, cx), (_, fy, cy), _ = np.asarray(matrix).tolist()
    k1, k2, p1, p2, k3 = np.ravel(distortion).tolist()
    camera = CalibratedCamera(*size, (fx, fy), (cx, cy), (k1, k2, p1, p2, k3), rms)
    angle = _largest_angle(np.asarray(rotations, np.float64))
    return _Fit(camera, tuple(np.ravel(errors).tolist()), angle)


def _largest_angle(rotations: Float64Array) -> float:
    """Return the largest angle between two boards, degrees; rotation vectors `(n, 3, 1)`."""
    normals = np.array([cv2.Rodrigues(rotation)[0][:, 2] for rotation in rotations])
    return float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1, 1).min())))


def _outliers(photos: list[BoardPhoto], errors: Sequence[float]) -> list[SkippedPhoto]:
    median = float(np.median(errors))
    return [
        SkippedPhoto(
            photo.path,
            f"is an outlier: error {error:.2f} px, more than {OUTLIER_RATIO:g} times the median "
            f"of {median:.2f} px",
        )
        for photo, error in zip(photos, errors, strict=True)
        if error > OUTLIER_RATIO * median
    ]


def _text(pattern: Pattern) -> str:
    return f"{pattern[0]}×{pattern[1]}"
