"""Vehicles on the road, rendered with light and shadow."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from docs.picture.landscape import CAMERA, LIGHT_ON_ROAD, bend, landscape
from docs.picture.light import (
    SKYLIGHT,
    SUN,
    SUNLIGHT,
    develop,
    haze,
    mix,
    ramp,
    rgb,
    surroundings,
    unit,
)
from docs.picture.paint import Surface, paint_car, paint_lorry
from docs.picture.shapes import Car, Shape

from vdet.boxes import Float32Array
from vdet.media.images import Image

Distance = Callable[[Float32Array], Float32Array]

_STRIP = 60  # rows of the landscape rendered at a time: this bounds the memory
_LIGHT_FROM_ROAD = 0.42 * rgb(120, 116, 112)


@dataclass(frozen=True)
class Vehicle:
    """A vehicle on the road: its rear is `ahead` of the camera, its middle at `lateral`, metres."""

    shape: Shape
    ahead: float
    lateral: float
    color: tuple[int, int, int]
    """Red, green, blue, 0 to 255."""
    text: str = ""
    """On the number plate."""
    braking: bool = False

    @property
    def axes(self) -> Float32Array:
        """Its axes `(3, 3)`, a row each, in those of the camera: the road turns it."""
        angle = CAMERA.curvature * self.ahead
        sine, cosine = np.sin(angle), np.cos(angle)
        return np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]], np.float32)

    def to_local(self, points: Float32Array) -> Float32Array:
        """Return points `(n, 3)` of the camera's axes in the vehicle's own."""
        origin = np.array([self.lateral + bend(self.ahead), 0, self.ahead], np.float32)
        return np.asarray((points - origin) @ self.axes.T, np.float32)

    def frame_box(self) -> tuple[float, float, float, float]:
        """Return bounds of the rays that may hit it: least and greatest `x`, then `y`."""
        half = self.shape.width / 2 + 0.1
        near, far = self.ahead - 0.1, self.ahead + self.shape.length + 0.1
        x = [(self.lateral + bend(z) + side) / z for z in (near, far) for side in (-half, half)]
        y = [(up - CAMERA.above_ground) / z for z in (near, far) for up in (0, self.shape.height)]
        return float(min(x)), float(max(x)), min(y), max(y)


class Motorway:
    """The road of the picture; it renders images of `scale` × `scale` rays per pixel."""

    def __init__(self, scale: int) -> None:
        columns = (np.arange(CAMERA.width * scale) + 0.5) / scale - 0.5 - CAMERA.width / 2
        rows = CAMERA.horizon - (np.arange(CAMERA.height * scale) + 0.5) / scale + 0.5
        self._x, self._y = np.meshgrid(
            (columns / CAMERA.focal).astype(np.float32), (rows / CAMERA.focal).astype(np.float32)
        )
        strips = [
            landscape(self._x[start : start + _STRIP], self._y[start : start + _STRIP])
            for start in range(0, len(rows), _STRIP)
        ]
        self._color = np.concatenate([strip.color for strip in strips])
        self._depth = np.concatenate([strip.depth for strip in strips])

    def image(self, vehicles: Iterable[Vehicle]) -> Image:
        """Return the road with vehicles, BGR uint8 of the camera's size."""
        color, depth = self._color.copy(), self._depth.copy()
        far_first = sorted(vehicles, key=lambda vehicle: -vehicle.ahead)
        for vehicle in far_first:
            self._cast_shadow(color, vehicle)
        for vehicle in far_first:
            self._draw(color, depth, vehicle)
        size = (CAMERA.width, CAMERA.height)
        return np.asarray(cv2.resize(develop(color), size, interpolation=cv2.INTER_AREA), np.uint8)

    def _cast_shadow(self, color: Float32Array, vehicle: Vehicle) -> None:
        """Take the light from the road that the vehicle keeps off."""
        shape, reach = vehicle.shape, 2 * vehicle.shape.height
        ahead = self._depth - vehicle.ahead
        rows = (self._y < 0) & (ahead > -1.5) & (ahead < shape.length + reach)
        place = np.nonzero(rows)
        x, z = self._x[place], self._depth[place]
        on_road = np.abs(self._y[place] * z + CAMERA.above_ground) < 0.01
        near = on_road & (np.abs(x * z - bend(z) - vehicle.lateral) < 2 + reach)
        place = place[0][near], place[1][near]
        x, z = self._x[place], self._depth[place]
        points = vehicle.to_local(np.stack([x * z, np.full_like(z, 0.004), z], axis=-1))
        sun = _sunlight(shape.distance, points, vehicle.axes @ SUN, 0.02, 7)
        sky = _skylight(
            shape.distance, points, np.array([0, 1, 0], np.float32), (0.08, 0.2, 0.4, 0.8)
        )
        from_sun, from_sky = LIGHT_ON_ROAD
        light = from_sun * sun[:, None] + from_sky * np.maximum(sky, 0.05)[:, None]
        color[place] *= light / (from_sun + from_sky)

    def _draw(self, color: Float32Array, depth: Float32Array, vehicle: Vehicle) -> None:
        left, right, low, high = vehicle.frame_box()
        columns = np.flatnonzero((self._x[0] > left) & (self._x[0] < right))
        rows = np.flatnonzero((self._y[:, 0] > low) & (self._y[:, 0] < high))
        area = np.ix_(rows, columns)
        rays = np.stack([self._x[area], self._y[area], np.ones_like(self._x[area])], axis=-1)
        rays = rays.reshape(-1, 3)
        start = vehicle.to_local(np.array([[0, CAMERA.above_ground, 0]], np.float32))[0]
        local = unit(rays) @ vehicle.axes.T
        end = vehicle.ahead + 1.1 * vehicle.shape.length + 1
        along = _trace(vehicle.shape.distance, start, local, vehicle.ahead - 0.5, end)
        z = along / np.linalg.norm(rays, axis=-1)
        hit = np.flatnonzero(z < depth[area].ravel())
        shaded = _shade(vehicle, start + local[hit] * along[hit, None], local[hit])
        row, column = rows[hit // len(columns)], columns[hit % len(columns)]
        color[row, column] = haze(shaded, z[hit])
        depth[row, column] = z[hit]


def _trace(
    distance: Distance, start: Float32Array, rays: Float32Array, near: float, far: float
) -> Float32Array:
    """Return how far along unit rays a surface is, infinite where there is none.

    This is sphere tracing (Hart 1996).
    """
    along = np.full(len(rays), near, np.float32)
    found = np.full(len(rays), np.inf, np.float32)
    active = np.arange(len(rays))
    for _ in range(100):
        step = distance(start + rays[active] * along[active, None])
        hit = step < 0.0012 * np.maximum(1, 0.04 * along[active])
        found[active[hit]] = along[active[hit]]
        along[active] += step
        active = active[~hit & (along[active] < far)]
    return found


def _sunlight(
    distance: Distance, points: Float32Array, sun: Float32Array, first: float, sharpness: float
) -> Float32Array:
    """Return the share of sunlight that reaches points, with soft shadows (Quilez)."""
    share = np.ones(len(points), np.float32)
    along = np.full(len(points), first, np.float32)
    for _ in range(32):
        step = distance(points + sun * along[:, None])
        share = np.minimum(share, np.clip(0.5 + sharpness * step / along, 0, 1))
        along += np.clip(step, first, 0.5)
    return share


def _skylight(
    distance: Distance, points: Float32Array, normals: Float32Array, heights: tuple[float, ...]
) -> Float32Array:
    """Return the share of the sky that points see: less where a surface is near."""
    share = np.ones(len(points), np.float32)
    for height in heights:
        gap = np.clip(height - distance(points + height * normals), 0, height) / height
        share -= gap * 1.2 / len(heights)
    return share


def _normals(distance: Distance, points: Float32Array) -> Float32Array:
    corners = np.array([[1, -1, -1], [-1, -1, 1], [-1, 1, -1], [1, 1, 1]], np.float32)
    return unit(sum(corner * distance(points + 0.004 * corner)[:, None] for corner in corners))


def _shade(vehicle: Vehicle, points: Float32Array, rays: Float32Array) -> Float32Array:
    """Return the colours of points on a vehicle, all in its own axes."""
    distance, sun = vehicle.shape.distance, vehicle.axes @ SUN
    normals = _normals(distance, points)
    surface = Surface(points, normals, rgb(*vehicle.color))
    if isinstance(vehicle.shape, Car):
        paint_car(surface, vehicle.shape, vehicle.text, braking=vehicle.braking)
    else:
        paint_lorry(surface, rgb(*vehicle.color))
    open_sky = np.clip(_skylight(distance, points, normals, (0.04, 0.12, 0.3)), 0.15, 1)
    open_sky *= np.clip(0.3 + points[:, 1] / 0.85, 0.3, 1)
    facing = normals @ sun
    sunlight = _sunlight(distance, points + 0.01 * normals, sun, 0.03, 12) * (facing > 0)

    around = mix(_LIGHT_FROM_ROAD, 1.05 * SKYLIGHT, 0.5 + 0.5 * normals[:, 1])
    light = 0.62 * SUNLIGHT * (sunlight * facing)[:, None] + around * open_sky[:, None]
    color = surface.color * light

    toward = (rays * normals).sum(axis=1)
    reflected = rays - 2 * toward[:, None] * normals
    fresnel = 0.04 + 0.96 * (1 - np.clip(-toward, 0, 1)) ** 5  # Schlick 1994
    coat, glass = np.clip(surface.gloss, 0, 1), np.clip(surface.gloss - 1, 0, 1)
    upper = ramp(0.6 * vehicle.shape.height, vehicle.shape.height, points[:, 1])
    mirror = coat * (0.9 * fresnel + 0.05) + glass * (0.10 + 0.18 * upper)
    mirror = np.clip(mirror * np.clip(1.1 * open_sky, 0, 1), 0, 1)
    color = mix(color, surroundings(reflected @ vehicle.axes), mirror)
    shine = np.maximum(reflected @ sun, 0)
    highlight = coat * sunlight * (0.10 * shine**18 + 1.1 * shine**220)
    return np.asarray(color + SUNLIGHT * highlight[:, None] + surface.glow, np.float32)
