"""Frames, and boxes in them, as a camera without lens distortion would see them."""

import cv2
import numpy as np
import numpy.typing as npt

from vdet.geometry import Box
from vdet.lanes.camera import Camera
from vdet.media.images import Image

_OUTLINE_POINTS = 16  # on each side of a box


class Undistorter:
    """Undoes one camera's lens distortion; focal length, principal point and size stay.

    May be shared by threads. Raises `ConfigError` for frames of another shape than the camera's.
    """

    def __init__(self, camera: Camera, width: int, height: int) -> None:
        self._camera = camera.scaled_to(width, height)
        matrix = self._camera.matrix
        self._maps = cv2.initUndistortRectifyMap(
            matrix,
            np.array(self._camera.distortion),
            np.eye(3),
            matrix,
            (width, height),
            cv2.CV_16SC2,
        )

    def image(self, image: Image) -> Image:
        """Return the undistorted frame, BGR uint8 `(H, W, 3)`; black where nothing was seen."""
        return np.asarray(cv2.remap(image, *self._maps, cv2.INTER_LINEAR), np.uint8)

    def points(self, points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return where pixels `(n, 2)` of the frame lie in the undistorted one."""
        matrix, distortion = self._camera.matrix, np.array(self._camera.distortion)
        moved = cv2.undistortPoints(points.reshape(-1, 1, 2), matrix, distortion, P=matrix)
        return np.asarray(moved, np.float64).reshape(-1, 2)

    def box(self, box: Box) -> Box:
        """Return the box around what `box` holds in the undistorted frame, to the nearest pixel.

        It is cut at the frame's edge; its area is 0 where nothing of it is left.
        """
        outline = self.points(_outline(box))
        left, top = np.rint(outline.min(axis=0) + 0.5).astype(int).tolist()
        right, bottom = np.rint(outline.max(axis=0) + 0.5).astype(int).tolist()
        moved = Box(left, top, right - left, bottom - top)
        return moved.clipped(self._camera.width, self._camera.height)


def _outline(box: Box) -> npt.NDArray[np.float64]:
    """Return points along the outline of a box's pixels (half a pixel outside their centres)."""
    x = np.linspace(box.x - 0.5, box.right - 0.5, _OUTLINE_POINTS)
    y = np.linspace(box.y - 0.5, box.bottom - 0.5, _OUTLINE_POINTS)
    sides = [
        np.column_stack([x, np.full_like(x, y[0])]),
        np.column_stack([x, np.full_like(x, y[-1])]),
        np.column_stack([np.full_like(y, x[0]), y]),
        np.column_stack([np.full_like(y, x[-1]), y]),
    ]
    return np.concatenate(sides)
