"""Pictures, points and boxes without the distortion of a lens; the file of a calibrated one."""

from pathlib import Path

import cv2
import numpy as np
import yaml

from vdet.boxes import Box, Float64Array, Image
from vdet.config.camera import LensSettings
from vdet.files import write_whole

_SIDE_POINTS = np.linspace(0, 1, 16)
_OUTLINE = np.array([(x, y) for x in _SIDE_POINTS for y in _SIDE_POINTS if {x, y} & {0, 1}])
"""Points on the sides of a box of side 1, `(n, 2)`."""

Maps = tuple[cv2.typing.MatLike, cv2.typing.MatLike]
"""Where each pixel comes from, as OpenCV takes it."""


def warped(layer: Image, maps: Maps, outside: int = 0) -> Image:
    """Return a layer of a picture with its pixels moved; it is `outside` beyond its sides."""
    border = cv2.BORDER_CONSTANT, (outside,)
    return np.asarray(cv2.remap(layer, *maps, cv2.INTER_LINEAR, None, *border), np.uint8)


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
        model = self._matrix, self._distortion, np.eye(3), self._matrix
        return warped(image, cv2.initUndistortRectifyMap(*model, self._size, cv2.CV_16SC2))

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
    """Write a lens as YAML that `-c` takes. Raises `OutputError`."""
    heading = "# A camera, written by `vdet calibrate`; lengths are pixels of its photographs.\n"
    text = yaml.safe_dump({"camera": {"lens": lens.model_dump(mode="json")}}, sort_keys=False)
    write_whole(path, heading + text, overwrite=overwrite)
