"""The shapes of vehicles, as signed distances.

Points `(n, 3)` are metres from the middle of a vehicle's rear, on the ground: x to the right, y up,
z ahead. A signed distance is negative inside the vehicle.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from vdet.boxes import Float32Array


class Shape(Protocol):
    """What rays need to know about a vehicle; lengths in metres."""

    @property
    def width(self) -> float:
        """Of the whole vehicle."""

    @property
    def length(self) -> float:
        """Of the whole vehicle."""

    @property
    def height(self) -> float:
        """Of the whole vehicle."""

    def distance(self, points: Float32Array) -> Float32Array:
        """Return signed distances `(n,)`, or a little less."""


@dataclass(frozen=True)
class Car:
    """A car: its side view, extruded over a width that shrinks towards the roof and the ends."""

    width: float
    length: float
    height: float
    outline: tuple[tuple[float, float], ...]
    """Corners `(z, y)` of the side view, clockwise from the lower rear."""
    belt: float
    """Height of the lower edge of the windows."""
    lean: float
    """Metres by which the sides lean inwards, for each metre above the belt."""
    seam: float
    """Height of the gap above the bumper."""
    plate: float
    """Height of the number plate."""
    rear_window: tuple[float, float, float]
    """Lower edge, upper edge, and half of the width at the lower edge."""
    side_windows: tuple[float, float, float]
    """Rear end, front end, and upper edge."""
    lights: tuple[float, float, float]
    """Height of the middle, height, and width."""
    wheel: float
    """Radius."""
    axles: tuple[float, float]

    def distance(self, points: Float32Array) -> Float32Array:
        """Return signed distances `(n,)`, or a little less."""
        x, y, z = np.abs(points[:, 0]), points[:, 1], points[:, 2]
        shape = _smooth_max(_to_polygon(z, y, self.outline), x - self.half_width(y, z), 0.16)
        for axle in self.axles:
            to_axle = np.hypot(z - axle, y - self.wheel) - self.wheel
            arch = np.where(x > self.width / 2 - 0.28, 0.06 - to_axle, -np.inf)
            wheel = np.maximum(to_axle, np.abs(x - self.width / 2 + 0.15) - 0.11)
            shape = np.minimum(np.maximum(shape, arch), wheel)
        return np.asarray(0.9 * shape, np.float32)

    def half_width(self, y: Float32Array, z: Float32Array) -> Float32Array:
        """Return half of the width at heights and distances from the rear."""
        ends = 0.14 * np.maximum(1 - z / 0.9, 0) ** 2
        ends += 0.16 * np.maximum(1 - (self.length - z) / 1.2, 0) ** 2
        lean = self.lean * np.maximum(y - self.belt, 0) + 0.28 * np.maximum(0.48 - y, 0)
        return np.asarray(self.width / 2 - lean - ends)


SALOON = Car(
    width=1.84, length=4.75, height=1.47,
    outline=(
        (0.15, 0.23), (0.01, 0.35), (-0.01, 0.6), (0.06, 0.7), (0.09, 0.98), (0.21, 1.08),
        (0.72, 1.07), (1.62, 1.41), (2.4, 1.46), (3.0, 1.42), (3.75, 1.01), (4.55, 0.85),
        (4.74, 0.6), (4.6, 0.23),
    ),
    belt=0.98, lean=0.34, seam=0.60, plate=0.80, rear_window=(1.08, 1.37, 0.62),
    side_windows=(1.0, 3.55, 1.34), lights=(0.86, 0.17, 0.46), wheel=0.33, axles=(0.95, 3.8),
)  # fmt: skip
HATCHBACK = Car(
    width=1.80, length=4.25, height=1.49,
    outline=(
        (0.13, 0.24), (0.0, 0.38), (-0.01, 0.62), (0.06, 0.7), (0.12, 0.98), (0.54, 1.41),
        (0.41, 1.47), (1.2, 1.48), (2.1, 1.47), (2.7, 1.41), (3.35, 1.01), (4.05, 0.87),
        (4.24, 0.6), (4.1, 0.24),
    ),
    belt=0.98, lean=0.30, seam=0.60, plate=0.74, rear_window=(1.02, 1.35, 0.60),
    side_windows=(0.75, 3.2, 1.36), lights=(0.90, 0.22, 0.36), wheel=0.33, axles=(0.78, 3.4),
)  # fmt: skip
OFF_ROADER = Car(
    width=1.94, length=4.75, height=1.74,
    outline=(
        (0.15, 0.31), (0.0, 0.46), (-0.01, 0.74), (0.06, 0.82), (0.09, 1.12), (0.49, 1.61),
        (0.29, 1.71), (1.2, 1.73), (2.5, 1.71), (3.0, 1.63), (3.6, 1.17), (4.5, 1.03),
        (4.74, 0.75), (4.6, 0.31),
    ),
    belt=1.12, lean=0.27, seam=0.70, plate=0.93, rear_window=(1.17, 1.56, 0.66),
    side_windows=(0.7, 3.5, 1.60), lights=(1.06, 0.20, 0.46), wheel=0.38, axles=(0.9, 3.75),
)  # fmt: skip
VAN = Car(
    width=1.98, length=5.3, height=2.07,
    outline=(
        (0.11, 0.31), (0.0, 0.45), (-0.01, 0.7), (0.04, 0.78), (0.06, 1.2), (0.15, 1.98),
        (0.29, 2.06), (3.6, 2.06), (4.1, 1.96), (4.75, 1.26), (5.2, 1.06), (5.29, 0.7),
        (5.2, 0.31),
    ),
    belt=1.15, lean=0.10, seam=0.66, plate=0.88, rear_window=(1.18, 1.80, 0.72),
    side_windows=(0.5, 4.1, 1.75), lights=(1.15, 0.46, 0.16), wheel=0.35, axles=(0.95, 4.1),
)  # fmt: skip


@dataclass(frozen=True)
class Lorry:
    """A lorry with a box body."""

    width: float = 2.55
    length: float = 12.0
    height: float = 3.95

    def distance(self, points: Float32Array) -> Float32Array:
        """Return signed distances `(n,)`."""
        x, y, z = np.abs(points[:, 0]), points[:, 1], points[:, 2]
        parts = [
            _to_box(x, y - 2.52, z - 4.6, (1.26, 1.40, 4.6)),
            _to_box(x, y - 1.02, z - 4.5, (0.45, 0.12, 4.4)),  # frame
            _to_box(x, y - 0.62, z - 0.12, (1.15, 0.07, 0.05)),  # underrun bar
            _to_box(x, y - 0.80, z - 0.10, (1.20, 0.11, 0.04)),  # board with lights
            _to_box(x - 0.95, y - 0.62, z - 0.98, (0.27, 0.30, 0.02)),  # mudguards
            _to_box(x, y - 1.9, z - 11.0, (1.22, 1.3, 1.0)),  # cab
        ]
        parts += [
            np.maximum(np.hypot(z - axle, y - 0.5) - 0.5, np.abs(x - 1.02) - 0.22)
            for axle in (1.6, 2.9, 4.2, 10.8)
        ]
        return np.asarray(np.min(parts, axis=0), np.float32)


LORRY = Lorry()


def to_rounded_rectangle(
    x: Float32Array, y: Float32Array, width: float, height: float, radius: float
) -> Float32Array:
    """Return signed distances to a rectangle around the origin with rounded corners."""
    across, up = np.abs(x) - width / 2 + radius, np.abs(y) - height / 2 + radius
    outside = np.hypot(np.maximum(across, 0), np.maximum(up, 0))
    return np.asarray(outside + np.minimum(np.maximum(across, up), 0) - radius)


def _to_box(
    x: Float32Array, y: Float32Array, z: Float32Array, half: tuple[float, float, float]
) -> Float32Array:
    """Return signed distances to a box around the origin, given half of its sides."""
    over = np.stack([np.abs(x) - half[0], np.abs(y) - half[1], np.abs(z) - half[2]]) + 0.02
    outside = np.linalg.norm(np.maximum(over, 0), axis=0)
    return np.asarray(outside + np.minimum(over.max(axis=0), 0) - 0.02)


def _to_polygon(
    z: Float32Array, y: Float32Array, corners: tuple[tuple[float, float], ...]
) -> Float32Array:
    """Return signed distances to a polygon (Quilez, "2D distance functions")."""
    square = np.full(z.shape, np.inf, np.float32)
    inside = np.zeros(z.shape, bool)
    for (z0, y0), (z1, y1) in pairwise((corners[-1], *corners)):
        side_z, side_y, from_z, from_y = z0 - z1, y0 - y1, z - z1, y - y1
        share = (from_z * side_z + from_y * side_y) / (side_z**2 + side_y**2)
        share = np.clip(share, 0, 1)
        square = np.minimum(square, (from_z - side_z * share) ** 2 + (from_y - side_y * share) ** 2)
        crosses = (y >= y1) != (y >= y0)
        inside ^= crosses & ((side_z * from_y > side_y * from_z) == (y0 > y1))
    return np.where(inside, -1, 1) * np.sqrt(square)


def _smooth_max(one: Float32Array, other: Float32Array, radius: float) -> Float32Array:
    """Return the maximum, larger where both are about equal: this rounds edges."""
    share = np.clip(0.5 + 0.5 * (one - other) / radius, 0, 1)
    return np.asarray(other + (one - other) * share + radius * share * (1 - share))
