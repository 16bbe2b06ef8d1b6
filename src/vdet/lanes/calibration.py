"""Chessboard photographs → a camera (Zhang 2000, as OpenCV does it)."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from vdet.errors import ImageError
from vdet.lanes.camera import Camera
from vdet.media.images import Image, read_image

MIN_VIEWS = 5
SIZE_TOLERANCE = 2
"""Pixels by which a photograph's sides may differ from the others'."""
MAX_SEARCHED = 1_300_000
"""Pixels of the picture in which a board is looked for: a larger photograph is reduced to it first,
for on large ones of grass or gravel OpenCV's search takes minutes."""
SPOILING = 3.0
"""A view is dropped where its error is more than this many times the median of all views."""
MIN_SLANT = 15.0
"""Degrees by which the boards of two photographs must be turned against each other."""

Corners = npt.NDArray[np.float32]
Pattern = tuple[int, int]


@dataclass(frozen=True, slots=True)
class View:
    """A photograph with the board's inner corners, pixels `(n, 2)`, row by row."""

    photo: Path
    size: tuple[int, int]
    """Width and height of the photograph."""
    corners: Corners


@dataclass(frozen=True, slots=True)
class Skipped:
    """A photograph that was not used, and why."""

    photo: Path
    reason: str


@dataclass(frozen=True, slots=True)
class Calibration:
    """A camera and what it was made from."""

    camera: Camera
    views: tuple[View, ...]
    errors: tuple[float, ...]
    """Of each view: root mean square distance of its corners, pixels."""
    skipped: tuple[Skipped, ...]


def calibrate(photos: Iterable[Path], pattern: Pattern) -> Calibration:
    """Find the camera that took these photographs of a flat chessboard.

    The frame size is the one that most photographs have; others are used as they are where their
    sides differ by at most `SIZE_TOLERANCE` pixels. After a first fit, views with an error above
    `SPOILING` × the median are dropped, and the rest is fitted again.

    Parameters
    ----------
    pattern
        Inner corners of the board, along and across.

    Raises
    ------
    ImageError
        Fewer than `MIN_VIEWS` photographs can be used, or all show the board from one side.
    """
    views, skipped = _find_boards(photos, pattern)
    views, odd = _of_one_size(views)
    skipped += odd
    _check_number(views, skipped, pattern)
    fit = _fit(views, pattern)
    if spoiling := _spoiling(views, fit.errors):
        skipped += spoiling
        dropped = {skip.photo for skip in spoiling}
        views = [view for view in views if view.photo not in dropped]
        _check_number(views, skipped, pattern)
        fit = _fit(views, pattern)
    _check_fit(fit)
    return Calibration(fit.camera, tuple(views), fit.errors, tuple(skipped))


def find_corners(image: Image, pattern: Pattern) -> Corners | None:
    """Return a board's inner corners, pixels `(n, 2)` with decimals; None where there is none."""
    gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    scale = min(1.0, math.sqrt(MAX_SEARCHED / gray.size))
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


def _find_boards(photos: Iterable[Path], pattern: Pattern) -> tuple[list[View], list[Skipped]]:
    views, skipped = [], []
    for photo in photos:
        try:
            image = read_image(photo)
        except ImageError as error:
            skipped.append(Skipped(photo, str(error).removeprefix(f"{photo}: ")))
            continue
        corners = find_corners(image, pattern)
        if corners is None:
            skipped.append(Skipped(photo, f"no board of {_words(pattern)} inner corners is seen"))
        else:
            views.append(View(photo, (image.shape[1], image.shape[0]), corners))
    return views, skipped


def _of_one_size(views: list[View]) -> tuple[list[View], list[Skipped]]:
    if not views:
        return [], []
    width, height = common_size(views)
    same, odd = [], []
    for view in views:
        if max(abs(view.size[0] - width), abs(view.size[1] - height)) <= SIZE_TOLERANCE:
            same.append(view)
        else:
            reason = f"is {view.size[0]}×{view.size[1]}, the others are {width}×{height}"
            odd.append(Skipped(view.photo, reason))
    return same, odd


def common_size(views: Iterable[View]) -> tuple[int, int]:
    """Return the size that most views have."""
    return Counter(view.size for view in views).most_common(1)[0][0]


def _check_number(views: list[View], skipped: list[Skipped], pattern: Pattern) -> None:
    if len(views) < MIN_VIEWS:
        raise ImageError(
            f"only {len(views)} of {len(views) + len(skipped)} photographs can be used, at least "
            f"{MIN_VIEWS} are needed; take more of the whole board from different sides, or "
            f"give another --pattern than {_words(pattern)}"
        )


@dataclass(frozen=True, slots=True)
class _Fit:
    camera: Camera
    errors: tuple[float, ...]
    slant: float
    """The largest angle between the boards of two views, degrees."""


def _check_fit(fit: _Fit) -> None:
    """Refuse boards all seen from one side: these fit cameras of any focal length."""
    if fit.slant < MIN_SLANT or fit.camera.flaw:
        raise ImageError(
            "the photographs do not tell the focal length: all show the board from much the same "
            f"side (they differ by {fit.slant:.0f}°, {MIN_SLANT:.0f}° are needed); take some with "
            "the board slanted, to the left and to the right, up and down"
        )


def _fit(views: list[View], pattern: Pattern) -> _Fit:
    """Fit a camera to the corners of all views. A square of the board is the unit of length."""
    board = np.zeros((pattern[0] * pattern[1], 3), np.float32)
    board[:, :2] = np.mgrid[: pattern[0], : pattern[1]].T.reshape(-1, 2)
    size = common_size(views)
    rms, matrix, distortion, turns, *_, errors = cv2.calibrateCameraExtended(
        [board] * len(views), [view.corners for view in views], size, np.eye(3), np.zeros(5)
    )
    (fx, _, cx), (_, fy, cy), _ = np.asarray(matrix).tolist()
    k1, k2, p1, p2, k3 = np.ravel(distortion).tolist()
    camera = Camera(*size, (fx, fy), (cx, cy), (k1, k2, p1, p2, k3), rms)
    return _Fit(camera, tuple(np.ravel(errors).tolist()), _slant(np.asarray(turns, np.float64)))


def _slant(turns: npt.NDArray[np.float64]) -> float:
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    return float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1, 1).min())))


def _spoiling(views: list[View], errors: Sequence[float]) -> list[Skipped]:
    median = float(np.median(errors))
    return [
        Skipped(
            view.photo,
            f"would spoil the fit: error {error:.2f} px, more than {SPOILING:g} times "
            f"the median of {median:.2f} px",
        )
        for view, error in zip(views, errors, strict=True)
        if error > SPOILING * median
    ]


def _words(pattern: Pattern) -> str:
    return f"{pattern[0]}×{pattern[1]}"
