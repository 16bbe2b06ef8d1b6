"""The pinhole camera, which projects points in metres to pixels; filled outlines; colours.

Points are metres: x to the right of the camera, y up from the ground, z ahead of the camera,
measured along the road. Pixels are x to the right, y down, whole numbers at pixel centres.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from vdet.boxes import Float64Array, Image
from vdet.draw.boxes import Color

NEAR = 0.5
"""Metres; nothing nearer than this is drawn."""

_SHIFT = 4  # fractional bits of the coordinates given to OpenCV


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """A camera above a flat road; the row of its horizon stands for its tilt.

    `width`, `height`, `focal` and `horizon` are pixels, `above_ground` is metres. `curvature` is
    that of the road ahead in 1/m, positive to the right: the road's centre at distance z is
    displaced by curvature · z² / 2.
    """

    width: int
    height: int
    focal: float
    horizon: float
    above_ground: float = 1.2
    curvature: float = 0.0

    @classmethod
    def dashboard(cls, width: int, height: int, curvature: float = 0.0) -> "PinholeCamera":
        """Return a typical dashboard camera: at 720 rows, focal length 1152 and horizon row 410."""
        return cls(width, height, 1.6 * height, 0.57 * height, curvature=curvature)

    @classmethod
    def pole(cls, width: int, height: int, above_ground: float = 8.0) -> "PinholeCamera":
        """Return a camera on a pole; it sees the road beyond 1.2 times its height."""
        return cls(width, height, 1.1 * height, 0.08 * height, above_ground)

    def project(self, points: Float64Array) -> Float64Array:
        """Return the pixels `(n, 2)` of points `(n, 3)`, all of them ahead of the camera."""
        x, y, z = points.T
        columns = self.width / 2 + self.focal * (x / z + self.curvature * z / 2)
        rows = self.horizon + self.focal * (self.above_ground - y) / z
        return np.column_stack([columns, rows])

    def draw(self, image: Image, polygon: Float64Array, color: Color) -> None:
        """Fill the part of a polygon `(n, 3)` beyond `NEAR`."""
        fill_outline(image, self.project(beyond_near(polygon)), color)


def beyond_near(polygon: Float64Array) -> Float64Array:
    """Return the part of a polygon `(n, 3)` at z ≥ `NEAR` (Sutherland and Hodgman 1974)."""
    ahead = polygon[:, 2] >= NEAR
    if ahead.all():
        return polygon
    kept = []
    for i, current in enumerate(polygon):
        previous = polygon[i - 1]
        if ahead[i - 1] != ahead[i]:
            fraction = (NEAR - previous[2]) / (current[2] - previous[2])
            kept.append(previous + fraction * (current - previous))
        if ahead[i]:
            kept.append(current)
    return np.array(kept).reshape(-1, 3)


def fill_outline(image: Image, outline: Float64Array, color: Color, *, smooth: bool = True) -> None:
    """Fill an outline of pixels `(n, 2)`; an empty outline changes nothing.

    Its edges are either smooth, or filled in every pixel that they touch.
    """
    if len(outline):
        fixed = np.rint(outline * (1 << _SHIFT)).astype(np.int32)
        cv2.fillPoly(image, [fixed], color, cv2.LINE_AA if smooth else cv2.LINE_8, _SHIFT)


def shaded(color: Color, factor: float) -> Color:
    """Return a colour made darker (factor below 1) or lighter (above 1)."""
    blue, green, red = (min(255, max(0, round(value * factor))) for value in color)
    return blue, green, red


def mixed(color: Color, second: Color, fraction: float) -> Color:
    """Return a colour mixed with a fraction, 0 to 1, of a second one."""
    blue, green, red = (round(a + (b - a) * fraction) for a, b in zip(color, second, strict=True))
    return blue, green, red
