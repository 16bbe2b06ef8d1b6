"""A calibrated camera and its file; pictures, points and boxes without its lens distortion."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import yaml
from pydantic import ConfigDict, Field, field_validator
from pydantic.dataclasses import dataclass
from pydantic_core.core_schema import ValidationInfo

from vdet.boxes import Box, Float64Array, Image
from vdet.config.document import read_values
from vdet.errors import ConfigError
from vdet.files import write_whole

_ASPECT_TOLERANCE = 0.005  # accepts 854×480 for 1280×720
_SIDE_POINTS = np.linspace(0, 1, 16)
_OUTLINE = np.array([(x, y) for x in _SIDE_POINTS for y in _SIDE_POINTS if {x, y} & {0, 1}])
"""Points on the sides of a box of side 1, `(n, 2)`."""

_MISTAKES = {
    "missing": "is missing; `vdet calibrate` writes camera files",
    "unexpected_keyword_argument": "is not a key of camera files",
}
"""Messages on camera files, by pydantic's type of the mistake."""

_Side = Annotated[int, Field(ge=16, le=100_000)]
_Coefficient = Annotated[float, Field(ge=-1000, le=1000)]
_Row = tuple[float, float, float]


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid", allow_inf_nan=False))
class CalibratedCamera:
    """A pinhole camera with lens distortion, for one frame size. Its fields are the file's keys.

    The distortion is Brown's model, as OpenCV implements it. All lengths are in pixels; x points
    right, y points down, and whole numbers are pixel centres.
    """

    width: _Side
    height: _Side
    matrix: tuple[_Row, _Row, _Row]
    """Focal lengths and principal point: `((fx, 0, cx), (0, fy, cy), (0, 0, 1))`."""
    distortion: tuple[_Coefficient, _Coefficient, _Coefficient, _Coefficient, _Coefficient]
    """k1, k2, p1, p2, k3."""
    rms: Annotated[float, Field(ge=0)]
    """Root mean square distance between the corners in the calibration photographs and the corners
    that the camera model predicts."""

    @field_validator("matrix")
    @classmethod
    def _check_matrix(
        cls, matrix: tuple[_Row, _Row, _Row], info: ValidationInfo
    ) -> tuple[_Row, _Row, _Row]:
        (fx, skew, x), (zero, fy, y), last = matrix
        width, height = (info.data.get(side) for side in ("width", "height"))
        if width and height:  # else they are wrong themselves
            is_real = 0.1 * width <= min(fx, fy) and max(fx, fy) <= 100 * width
            in_frame = 0 <= x < width and 0 <= y < height
            if not (is_real and in_frame and (skew, zero, last) == (0, 0, (0, 0, 1))):
                raise ValueError(
                    "should be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], with focal lengths of 0.1 to "
                    "100 times the width, and the principal point in the frame"
                )
        return matrix

    def matrix_for(self, width: int, height: int) -> Float64Array:
        """Return the camera matrix `(3, 3)` for frames of another size, but the same aspect ratio.

        Raises
        ------
        ConfigError
            The aspect ratio differs, so the frame is not a resized one.
        """
        across, down = width / self.width, height / self.height
        if abs(across / down - 1) > _ASPECT_TOLERANCE:
            raise ConfigError(
                f"camera: is for {self.width}×{self.height}, not {width}×{height}; calibrate again"
            )
        (fx, _, cx), (_, fy, cy), last = self.matrix
        x, y = (cx + 0.5) * across - 0.5, (cy + 0.5) * down - 0.5
        return np.array([(fx * across, 0, x), (0, fy * down, y), last])


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

    def __init__(self, camera: CalibratedCamera | None, width: int, height: int) -> None:
        self._camera = camera
        if camera:
            self._size = width, height
            self._matrix = camera.matrix_for(width, height)
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


def save_camera(camera: CalibratedCamera, path: Path, *, overwrite: bool = False) -> None:
    """Write a camera as YAML. Raises `OutputError`."""
    heading = "# A camera, written by `vdet calibrate`; lengths are pixels of its photographs.\n"
    text = yaml.safe_dump(asdict(camera), sort_keys=False)
    write_whole(path, heading + text, overwrite=overwrite)


def load_camera(path: Path) -> CalibratedCamera:
    """Read a camera file.

    Raises
    ------
    ConfigError
        The file cannot be read, is not YAML, or is not a camera file; one line for each mistake.
    """
    return read_values(path, CalibratedCamera, _MISTAKES)
