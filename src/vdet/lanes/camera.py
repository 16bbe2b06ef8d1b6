"""A camera: its lens, the road from straight above, and where on the road a pixel is.

The lens is calibrated by chessboard photographs (Zhang 2000, in OpenCV's implementation), and its
distortion can be removed from frames.

In the top view the ground is taken as flat. Its coordinates are x, metres to the right of the
camera, and z, metres ahead of it. The column of the vanishing point is x = 0 at every distance;
that is exact if the camera looks along the road and does not roll.

The road plane is fitted to points whose metres are known, and taken as flat, too. A homography
(Hartley and Zisserman 2004, ch. 4) is fitted so that the squared distances in pixels are smallest,
because it is pixels that are read off a picture.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import mode

import cv2
import numpy as np
import yaml
from pydantic import ValidationError

from vdet.boxes import Box, Float32Array, Float64Array, Image
from vdet.config.scene import CameraSettings, LensSettings
from vdet.config.schema import LaneSettings
from vdet.errors import ConfigError, ImageError
from vdet.files import write_whole
from vdet.media.images import read_image

_SIDE_POINTS = np.linspace(0, 1, 16)
_OUTLINE = np.array([(x, y) for x in _SIDE_POINTS for y in _SIDE_POINTS if {x, y} & {0, 1}])
"""Points on the sides of a box of side 1, `(n, 2)`."""

Maps = tuple[cv2.typing.MatLike, cv2.typing.MatLike]
"""Where each pixel comes from, as OpenCV takes it."""

ACROSS = 30.0
"""Pixels per metre, across the road."""
ALONG = 8.0
"""Pixels per metre, along the road."""
_ASSUMED = 3.7, 37.0
"""`lanes.metres` where it is not set, across and along: for the search, not for results."""
_MARGIN = 3.0
"""Metres of road that are shown on each side of the lane."""

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

_THIN = 0.01
"""Width of points that count as one line, as a fraction of their length."""
_MIN_LENGTH = 1.0
"""Minimum length of the area, metres."""
_MAX_ERROR = 0.03
"""Largest error of the fit, as a fraction of the length of the area."""


def warped(layer: Image, maps: Maps, outside: int = 0) -> Image:
    """Return a remapped layer of a picture; pixels from beyond its edges are `outside`."""
    x, y = maps
    return np.asarray(cv2.remap(layer, x, y, cv2.INTER_LINEAR, borderValue=(outside,)), np.uint8)


class Undistorter:
    """Removes the lens distortion of one camera from frames of one size, and adds it.

    Focal lengths, principal point and frame size stay the same. Without a camera, nothing changes.

    Raises
    ------
    ConfigError
        The aspect ratio of the frames is not the camera's.
    """

    def __init__(self, camera: LensSettings | None, width: int, height: int) -> None:
        self._camera = camera
        if camera:
            self._size = width, height
            self._matrix = np.array(camera.matrix_for(width, height))
            self._to_rays = np.linalg.inv(self._matrix)
            self._distortion = np.array(camera.distortion)

    def image(self, image: Image) -> Image:
        """Return an undistorted image; it is black outside the camera's view."""
        if not self._camera:
            return image.copy()
        return np.asarray(cv2.undistort(image, self._matrix, self._distortion), np.uint8)

    def points(self, points: Float64Array) -> Float64Array:
        """Return where pixels `(n, 2)` of the frame lie in the undistorted frame, `(n, 2)`."""
        if not self._camera:
            return points
        matrix, distortion = self._matrix, self._distortion
        moved = cv2.undistortPoints(points[:, None], matrix, distortion, P=matrix)
        return np.asarray(moved, np.float64).reshape(-1, 2)

    def distorted(self, points: Float64Array) -> Float64Array:
        """Return where pixels `(n, 2)` of the undistorted frame lie in the frame, `(n, 2)`."""
        if not self._camera:
            return points
        rays = np.column_stack([points, np.ones(len(points))]) @ self._to_rays.T
        zero = np.zeros(3)
        moved, _ = cv2.projectPoints(rays, zero, zero, self._matrix, self._distortion)
        return np.asarray(moved, np.float64).reshape(-1, 2)

    def box(self, box: Box) -> Box:
        """Return the box around the content of `box` in the undistorted frame, in whole pixels.

        It is clipped to the frame. Its area is 0 if it lies outside.
        """
        if not self._camera:
            return box
        size = box.x2 - box.x1, box.y2 - box.y1
        moved = self.points(_OUTLINE * size + (box.x1 - 0.5, box.y1 - 0.5))
        left, top = np.rint(moved.min(axis=0) + 0.5).astype(int).tolist()
        right, bottom = np.rint(moved.max(axis=0) + 0.5).astype(int).tolist()
        return Box(left, top, right, bottom).clipped(*self._size)


def save_camera(lens: LensSettings, path: Path, *, overwrite: bool = False) -> None:
    """Write a lens as YAML that `-c` accepts. Raises `OutputError`."""
    heading = "# A camera, written by `vdet calibrate`; lengths are pixels of its photographs.\n"
    text = yaml.safe_dump({"camera": {"lens": lens.model_dump(mode="json")}}, sort_keys=False)
    write_whole(path, heading + text, overwrite=overwrite)


class TopView:
    """Converts between ground, undistorted frames of one size, and pictures from above."""

    def __init__(self, settings: LaneSettings, width: int, height: int) -> None:
        self.lane_width, self.length = settings.metres or _ASSUMED
        """Of the lane that is looked for, and along the trapezoid, metres."""
        corners = np.array(settings.for_frames(width, height).points)
        near_left, near_right, far_right, far_left = corners[:, 0].tolist()
        near, far = near_right - near_left, far_right - far_left
        start = self.length * far / (near - far)  # widths in the frame are proportional to 1/z
        end = start + self.length
        left = (near_left - far_left) / (near - far) * self.lane_width
        right = left + self.lane_width
        ground = np.array([(left, start), (right, start), (right, end), (left, end)], np.float32)
        to_frame = cv2.getPerspectiveTransform(ground, corners.astype(np.float32))
        self._to_frame = np.asarray(to_frame, np.float64)
        """From `(x, z, 1)`, metres, to pixels of the undistorted frame."""
        self._to_ground = np.linalg.inv(self._to_frame)
        rows = round(self.length * ALONG)
        columns = round((self.lane_width + 2 * _MARGIN) * ACROSS)
        self.distances = start + (rows - 0.5 - np.arange(rows, dtype=np.float64)) / ALONG
        """z of each row, metres; the first row is the farthest."""
        self.laterals = (np.arange(columns, dtype=np.float64) + 0.5 - columns / 2) / ACROSS
        """x of each column, metres."""
        x, z = self.laterals[0], self.distances[0]
        self._warp = self._to_frame @ [[1 / ACROSS, 0, x], [0, -1 / ALONG, z], [0, 0, 1]]
        """From `(column, row, 1)` of the top view to pixels of the undistorted frame."""
        self._to_top = np.asarray(np.linalg.inv(self._warp), np.float64)

    def pixels(self) -> Float64Array:
        """Return the pixels of the undistorted frame that the view shows, `(rows, columns, 2)`."""
        rows, columns = np.mgrid[: len(self.distances), : len(self.laterals)]
        shown = _transform(self._warp, np.column_stack([columns.ravel(), rows.ravel()]))
        return shown.reshape(*rows.shape, 2)

    def picture(self, frame: Image) -> Image:
        """Return an undistorted frame as seen from above."""
        size = len(self.laterals), len(self.distances)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpPerspective(frame, self._warp, size, flags=flags), np.uint8)

    def ground_to_frame(self, x: Float64Array, z: Float64Array) -> Float64Array:
        """Return the pixels `(n, 2)` in the undistorted frame of ground points, metres `(n,)`."""
        return _transform(self._to_frame, np.asarray(np.column_stack([x, z]), np.float64))

    def sight(self, pixel: tuple[float, float]) -> tuple[float, float]:
        """Return x / z and 1 / z of the ground point at a pixel of the undistorted frame.

        1 / z, in 1/m, is proportional to the rows below the horizon; it is 0 there, and negative
        above it. x / z does not depend on the scale of the ground, and has no unit.
        """
        x, z, scale = (self._to_ground @ (*pixel, 1.0)).tolist()
        return x / z, scale / z

    def frame_to_top(self, pixels: Float64Array) -> Float64Array:
        """Return where pixels `(n, 2)` of the undistorted frame lie in the top view, `(n, 2)`."""
        return _transform(self._to_top, pixels)

    @property
    def outline(self) -> Float64Array:
        """The corners of the top view in the undistorted frame, pixels `(4, 2)`."""
        right, bottom = len(self.laterals) - 0.5, len(self.distances) - 0.5
        corners = [[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]]
        return _transform(self._warp, np.array(corners))


def _transform(matrix: Float64Array, points: Float64Array) -> Float64Array:
    """Apply a homography to points `(n, 2)`."""
    moved = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(moved[:, :2] / moved[:, 2:])


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


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """The road plane in frames of one size.

    Attributes
    ----------
    to_metres
        Homography `(3, 3)` from pixels of the undistorted frame, positive below the horizon.
    area
        Corners of the calibrated area in order around it, metres `(n, 2)`.
    error, pixel_error
        Root mean square distance of the points from the fit, metres and pixels.
    row
        Metres of road per row of pixels at the points, the median.
    """

    to_metres: Float64Array
    area: Float64Array
    error: float
    pixel_error: float
    row: float
    undistorter: Undistorter

    @property
    def length(self) -> float:
        """The largest distance in the calibrated area, metres."""
        return _length(self.area)

    @property
    def scale_error(self) -> float:
        """Relative standard deviation of lengths, for points that are off by at least a pixel."""
        return self.row * max(self.pixel_error, 1.0) / self.length

    def metres(self, pixels: Float64Array) -> Float64Array:
        """Return where on the road points `(n, 2)` of the frame are, metres `(n, 2)`.

        Whole numbers of pixels are the edges of pixels, as in boxes. NaN above the horizon, and
        farther from the calibrated area than its own length.
        """
        metres = _mapped(self.to_metres, self.undistorter.points(pixels - 0.5))
        along = np.roll(self.area, -1, axis=0) - self.area
        outward = np.column_stack([along[:, 1], -along[:, 0]]) / _lengths(along)[:, None]
        outside = (metres[:, None] - self.area) * outward
        beyond = outside.sum(axis=2).max(axis=1)
        return np.where((beyond <= self.length)[:, None], metres, np.nan)


def ground_of(camera: CameraSettings, width: int, height: int) -> Ground | None:
    """Fit the road plane of a camera for frames of `width` × `height` pixels.

    None without points, and where these do not give lengths along the road.

    Raises
    ------
    ConfigError
        The points do not fix a plane or do not fit together, or the lens is for other frames.
    """
    if not camera.ground or camera.lack_of_speeds:
        return None
    points = [point.for_frames(width, height) for point in camera.ground]
    pixels = np.array([point.pixel for point in points], np.float64)
    metres = np.array([point.metres for point in points], np.float64)
    return fit_ground(pixels, metres, Undistorter(camera.lens, width, height))


def fit_ground(pixels: Float64Array, metres: Float64Array, undistorter: Undistorter) -> Ground:
    """Fit the plane to points in pixels of the frame and in metres, `(n, 2)` each.

    Raises
    ------
    ConfigError
        There are fewer than four points, all or all but one lie on a line, the horizon runs between
        them, or they do not fit together.
    """
    if len(pixels) < 4:
        raise ConfigError(f"camera.ground: has {len(pixels)} points; must be at least four")
    if (length := _length(metres)) < _MIN_LENGTH:
        fault = f"all points are within {length:.2g} m; metres are expected, not degrees"
        raise ConfigError(f"camera.ground: {fault}")
    metres = metres - np.round(
        metres.mean(axis=0), -3
    )  # origins may be thousands of kilometres away
    straight = undistorter.points(pixels)
    for points, unit in ((straight, "pixel"), (metres, "metres")):
        if any(_is_thin(np.delete(points, row, axis=0)) for row in range(len(points))):
            raise ConfigError(
                f"camera.ground: all points, or all but one, are on a line ({unit}); add corners"
            )
    to_pixels, _ = cv2.findHomography(metres, straight)
    inverse = np.linalg.inv(to_pixels) if to_pixels is not None else np.zeros((3, 3))
    depths = straight @ inverse[2, :2] + inverse[2, 2]
    if not (np.all(depths > 0) or np.all(depths < 0)):
        raise ConfigError("camera.ground: the horizon is between the points; two may be swapped")
    to_metres = np.asarray(inverse * np.sign(depths[0]), np.float64)
    off = _lengths(_mapped(to_metres, straight) - metres)
    back = np.asarray(np.linalg.inv(to_metres), np.float64)
    pixel_off = _lengths(_mapped(back, metres) - straight)
    area = cv2.convexHull(metres.astype(np.float32))[:, 0].astype(np.float64)
    error, pixel_error = (float(np.sqrt(np.mean(item**2))) for item in (off, pixel_off))
    if error > _MAX_ERROR * _length(area):
        worst = int(np.argmax(pixel_off))
        raise ConfigError(
            f"camera.ground[{worst}]: is {off[worst]:.1f} m from where the other points place it"
        )
    rows = _mapped(to_metres, straight + np.array((0, 1))) - _mapped(to_metres, straight)
    row = float(np.median(_lengths(rows)))
    return Ground(to_metres, area, error, pixel_error, row, undistorter)


def _mapped(matrix: Float64Array, points: Float64Array) -> Float64Array:
    """Apply a homography to points `(n, 2)`; NaN where its last row is not positive."""
    moved = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(moved[:, :2] / np.where(moved[:, 2:] > 0, moved[:, 2:], np.nan))


def _is_thin(points: Float64Array) -> bool:
    lengths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(lengths[1] <= _THIN * lengths[0])


def _lengths(vectors: Float64Array) -> Float64Array:
    return np.asarray(np.hypot(vectors[..., 0], vectors[..., 1]))


def _length(points: Float64Array) -> float:
    return float(np.max(_lengths(points[:, None] - points)))
