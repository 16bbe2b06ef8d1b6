"""The road from above, and where its metres lie in the frame.

The ground is flat: x metres to the right of the camera, z metres ahead of it. The column of the
vanishing point is x = 0 at any distance, if the camera looks along the road and does not roll.
"""

import cv2
import numpy as np

from vdet.config.lanes import ViewSettings
from vdet.geometry import Float64Array
from vdet.media.images import Image


class View:
    """Maps undistorted frames of one size to pictures from above, and ground to frame."""

    def __init__(self, settings: ViewSettings, width: int, height: int) -> None:
        self._to_frame = _ground_to_frame(settings, width, height)
        near = _nearest(settings)
        rows = round(settings.length * settings.along)
        columns = round((settings.lane_width + 2 * settings.margin) * settings.across)
        self.across, self.along = settings.across, settings.along
        self.distances = near + (rows - 0.5 - np.arange(rows, dtype=np.float64)) / settings.along
        """z of each row, metres; the first row is the farthest."""
        self.laterals = (np.arange(columns, dtype=np.float64) + 0.5 - columns / 2) / settings.across
        """x of each column, metres."""
        self._warp = self._to_frame @ self._to_ground_matrix()

    def from_above(self, image: Image) -> Image:
        """Return the road of an undistorted frame `(H, W, 3)` from above, `(rows, columns, 3)`."""
        size = (len(self.laterals), len(self.distances))
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpPerspective(image, self._warp, size, flags=flags), np.uint8)

    def to_frame(self, x: Float64Array, z: Float64Array) -> Float64Array:
        """Return the pixels `(n, 2)` in the undistorted frame of points of the ground, metres."""
        return _transform(self._to_frame, np.asarray(np.column_stack([x, z]), np.float64))

    def to_above(self, pixels: Float64Array) -> Float64Array:
        """Return where pixels `(n, 2)` of the undistorted frame are seen from above, `(n, 2)`."""
        return _transform(np.asarray(np.linalg.inv(self._warp), np.float64), pixels)

    @property
    def outline(self) -> Float64Array:
        """The corners, in the undistorted frame, of what is seen from above, pixels `(4, 2)`."""
        right, bottom = len(self.laterals) - 0.5, len(self.distances) - 0.5
        corners = [[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]]
        return _transform(self._warp, np.array(corners))

    def columns(self, x: Float64Array) -> Float64Array:
        """Return the columns, seen from above, of lateral positions in metres."""
        return np.asarray((x - self.laterals[0]) * self.across)

    def _to_ground_matrix(self) -> Float64Array:
        """Return the matrix that takes `(column, row, 1)` from above to `(x, z, 1)`."""
        return np.array(
            [
                [1 / self.across, 0, self.laterals[0]],
                [0, -1 / self.along, self.distances[0]],
                [0, 0, 1],
            ]
        )


def _transform(matrix: Float64Array, points: Float64Array) -> Float64Array:
    """Apply a homography to points `(n, 2)`."""
    moved = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(moved[:, :2] / moved[:, 2:])


def _nearest(settings: ViewSettings) -> float:
    """Return how far ahead the nearer row is: widths in the frame go as 1 / distance."""
    far, near = _widths(settings)
    return settings.length * far / (near - far)


def _widths(settings: ViewSettings) -> tuple[float, float]:
    far = settings.top_right - settings.top_left
    return far, settings.bottom_right - settings.bottom_left


def _ground_to_frame(settings: ViewSettings, width: int, height: int) -> Float64Array:
    """Return the homography `(3, 3)` from `(x, z, 1)`, metres, to undistorted pixels."""
    far, near = _widths(settings)
    slope = (settings.top_left - settings.bottom_left) / (near - far)
    vanishing = settings.bottom_left + slope * near  # where the lines would meet
    left = (settings.bottom_left - vanishing) / near * settings.lane_width
    right = left + settings.lane_width
    start = _nearest(settings)
    end = start + settings.length
    ground = np.array([[left, start], [right, start], [right, end], [left, end]], np.float32)
    frame = np.array(
        [
            [settings.bottom_left * width, settings.bottom * height],
            [settings.bottom_right * width, settings.bottom * height],
            [settings.top_right * width, settings.top * height],
            [settings.top_left * width, settings.top * height],
        ],
        np.float32,
    )
    return np.asarray(cv2.getPerspectiveTransform(ground, frame), np.float64)
