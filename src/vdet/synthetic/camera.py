"""The pinhole camera: from points in metres to pixels.

Points are metres: x to the right of the camera, y up from the ground, z ahead of the camera,
measured along the road. Pixels are x to the right, y down, whole numbers at pixel centres.
"""

from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float64Array

NEAR = 0.5
"""Metres; nothing nearer than this is drawn."""


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """A level camera over a flat road; the row of the horizon stands for its tilt.

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
        """Return a usual dashboard camera: at 720 rows, focal length 1152 and horizon row 410."""
        return cls(width, height, 1.6 * height, 0.57 * height, curvature=curvature)

    def project(self, points: Float64Array) -> Float64Array:
        """Return the pixels `(n, 2)` of points `(n, 3)`, all of them ahead of the camera."""
        x, y, z = points.T
        pixels = np.empty((len(points), 2))
        pixels[:, 0] = self.width / 2 + self.focal * (x / z + self.curvature * z / 2)
        pixels[:, 1] = self.horizon + self.focal * (self.above_ground - y) / z
        return pixels

    def outline(self, polygon: Float64Array) -> Float64Array:
        """Return the pixels `(m, 2)` of the part of a polygon `(n, 3)` beyond `NEAR`."""
        return self.project(beyond_near(polygon))


def beyond_near(polygon: Float64Array) -> Float64Array:
    """Return the part of a polygon `(n, 3)` at z ≥ `NEAR` (Sutherland and Hodgman 1974)."""
    ahead = polygon[:, 2] >= NEAR
    if ahead.all():
        return polygon
    kept = []
    for i in range(len(polygon)):
        previous, current = polygon[i - 1], polygon[i]
        if ahead[i - 1] != ahead[i]:
            share = (NEAR - previous[2]) / (current[2] - previous[2])
            kept.append(previous + share * (current - previous))
        if ahead[i]:
            kept.append(current)
    return np.array(kept).reshape(-1, 3)


def distances(start: float, end: float) -> Float64Array:
    """Return distances from `start` to `end`, 5 % apart, which is enough to follow any bend."""
    return np.geomspace(start, end, 2 + int(20 * np.log(end / start)))
