"""The road plane of a camera: from pixels to metres, fitted to points whose metres are known.

The plane is taken as flat. A homography (Hartley and Zisserman 2004, ch. 4) is fitted so that the
squared distances in pixels are smallest, because it is pixels that are read off a picture.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from vdet.boxes import Float64Array
from vdet.config.scene import CameraSettings
from vdet.errors import ConfigError
from vdet.lanes.camera import Undistorter

_THIN = 0.01
"""Width of points that count as one line, as a fraction of their length."""
_MIN_LENGTH = 1.0
"""Minimum length of the area, metres."""
_MAX_ERROR = 0.03
"""Largest error of the fit, as a fraction of the length of the area."""


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
