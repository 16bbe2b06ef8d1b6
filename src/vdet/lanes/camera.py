"""A calibrated camera, and frames and boxes without its lens distortion."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from vdet.boxes import Box, Float64Array
from vdet.errors import ConfigError
from vdet.media.images import Image

_ASPECT_TOLERANCE = 0.005  # accepts 854×480 for 1280×720
_OUTLINE_POINTS = 16  # on each side of a box


@dataclass(frozen=True, slots=True)
class CalibratedCamera:
    """A pinhole camera with lens distortion, for one frame size.

    The distortion is Brown's model, as OpenCV implements it. All lengths are in pixels; x points
    right, y points down, and whole numbers are pixel centres.
    """

    width: int
    height: int
    focal: tuple[float, float]
    """Focal lengths along x and y."""
    center: tuple[float, float]
    """Principal point `(x, y)`."""
    distortion: tuple[float, float, float, float, float]
    """k1, k2, p1, p2, k3."""
    rms: float
    """Root mean square distance between the corners in the calibration photographs and the corners
    that the camera model predicts."""

    @property
    def matrix(self) -> Float64Array:
        """The camera matrix, `(3, 3)`."""
        (fx, fy), (cx, cy) = self.focal, self.center
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])

    @property
    def problem(self) -> str | None:
        """Why no real camera has these values; None if one may have them."""
        shortest, longest = 0.1 * self.width, 100.0 * self.width
        if not all(shortest <= length <= longest for length in self.focal):
            return f"focal lengths should be {shortest:g} to {longest:g} px at this frame size"
        x, y = self.center
        if not (0 <= x < self.width and 0 <= y < self.height):
            return f"the principal point should lie in the frame (is {x:.6g}, {y:.6g})"
        return None

    def scaled_to(self, width: int, height: int) -> "CalibratedCamera":
        """Return the same camera for frames of another size with the same aspect ratio.

        Raises
        ------
        ConfigError
            The aspect ratio differs, so the frame is not a resized one.
        """
        across, down = width / self.width, height / self.height
        if abs(across / down - 1) > _ASPECT_TOLERANCE:
            raise ConfigError(
                f"the camera was calibrated for {self.width}×{self.height} and cannot be scaled "
                f"to {width}×{height}, another aspect ratio; calibrate with photographs of that "
                "aspect ratio"
            )
        (fx, fy), (cx, cy) = self.focal, self.center
        return replace(
            self,
            width=width,
            height=height,
            focal=(fx * across, fy * down),
            center=((cx + 0.5) * across - 0.5, (cy + 0.5) * down - 0.5),
            rms=self.rms * down,
        )


class Undistorter:
    """Removes the lens distortion of one camera from frames of one size.

    Focal lengths, principal point and frame size stay the same. Threads may share an undistorter.

    Raises
    ------
    ConfigError
        The aspect ratio of the frames is not the camera's.
    """

    def __init__(self, camera: CalibratedCamera, width: int, height: int) -> None:
        self._camera = camera.scaled_to(width, height)
        self._matrix = self._camera.matrix
        self._distortion = np.array(self._camera.distortion)
        self._maps = cv2.initUndistortRectifyMap(
            self._matrix, self._distortion, np.eye(3), self._matrix, (width, height), cv2.CV_16SC2
        )

    def image(self, image: Image) -> Image:
        """Return the undistorted frame, BGR uint8 `(H, W, 3)`; black outside the camera's view."""
        return np.asarray(cv2.remap(image, *self._maps, cv2.INTER_LINEAR), np.uint8)

    def points(self, points: Float64Array) -> Float64Array:
        """Return where pixels `(n, 2)` of the frame lie in the undistorted frame, `(n, 2)`."""
        moved = cv2.undistortPoints(
            points.reshape(-1, 1, 2), self._matrix, self._distortion, P=self._matrix
        )
        return np.asarray(moved, np.float64).reshape(-1, 2)

    def box(self, box: Box) -> Box:
        """Return the box around the content of `box` in the undistorted frame, in whole pixels.

        It is clipped to the frame. Its area is 0 if it lies outside.
        """
        outline = self.points(_outline(box))
        left, top = np.rint(outline.min(axis=0) + 0.5).astype(int).tolist()
        right, bottom = np.rint(outline.max(axis=0) + 0.5).astype(int).tolist()
        return Box(left, top, right, bottom).clipped(self._camera.width, self._camera.height)


def _outline(box: Box) -> Float64Array:
    """Return points on the outline of a box, half a pixel outside its outer pixel centres."""
    x = np.linspace(box.x1 - 0.5, box.x2 - 0.5, _OUTLINE_POINTS)
    y = np.linspace(box.y1 - 0.5, box.y2 - 0.5, _OUTLINE_POINTS)
    sides = [
        np.column_stack([x, np.full_like(x, y[0])]),
        np.column_stack([x, np.full_like(x, y[-1])]),
        np.column_stack([np.full_like(y, x[0]), y]),
        np.column_stack([np.full_like(y, x[-1]), y]),
    ]
    return np.concatenate(sides)
