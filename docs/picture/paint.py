"""The materials of vehicles: paint, glass, rubber, lights."""

import cv2
import numpy as np
from docs.picture.light import ramp, rgb
from docs.picture.shapes import VAN, Car, to_rounded_rectangle

from vdet.boxes import Float32Array

MATT, CLEAR_COAT, GLASS = 0.1, 1.0, 2.0

_BLACK, _RUBBER = rgb(22, 22, 24), rgb(25, 25, 26)
_GLASS, _CHROME, _RIM = rgb(16, 20, 22), rgb(190, 192, 196), rgb(168, 170, 174)
_RED, _GLOW = np.array([0.36, 0.012, 0.012], np.float32), np.array([0.3, 0.016, 0.011], np.float32)
_PLATE, _INK = rgb(228, 230, 228), rgb(30, 32, 40)
_BODY, _STEEL = rgb(232, 234, 236), rgb(150, 154, 158)


class Surface:
    """The material at points `(n, 3)` of a vehicle with normals `(n, 3)`, both in its own axes."""

    def __init__(self, points: Float32Array, normals: Float32Array, color: Float32Array) -> None:
        self.x, self.y, self.z = points.T
        self.side = np.abs(self.x)
        """Distance from the middle."""
        self.normals = normals
        self.color = np.tile(color, (len(points), 1))
        self.gloss = np.full(len(points), CLEAR_COAT, np.float32)
        """From matt (0) over clear coat (1) to glass (2)."""
        self.glow = np.zeros((len(points), 3), np.float32)

    def paint(
        self,
        cover: Float32Array,
        color: Float32Array,
        gloss: float,
        glow: Float32Array | float = 0.0,
    ) -> None:
        """Give the part of the points that `cover`, 0 to 1, tells another material."""
        share = cover[:, None]
        self.color = np.asarray(self.color + (color - self.color) * share, np.float32)
        self.glow = np.asarray(self.glow + (glow - self.glow) * share, np.float32)
        self.gloss = np.asarray(self.gloss + (gloss - self.gloss) * cover, np.float32)

    def rectangle(
        self, x: float, y: float, width: float, height: float, radius: float = 0.0
    ) -> Float32Array:
        """Return signed distances to a rectangle on the rear, and to its mirror image."""
        return to_rounded_rectangle(self.side - x, self.y - y, width, height, radius)


def paint_car(surface: Surface, car: Car, text: str, *, braking: bool) -> None:
    """Paint the parts of a car over its colour."""
    rear = (surface.normals[:, 2] < -0.25) & (surface.z < 1.9)
    flank = np.abs(surface.normals[:, 0]) > 0.6
    _paint_gaps(surface, car, rear, flank)
    _paint_windows(surface, car, rear, flank)
    _paint_lights(surface, car, bright=braking)
    _paint_plate(surface, rear, car.plate, text)
    badge = np.hypot(surface.x, surface.y - car.plate - 0.115) - 0.032
    surface.paint(_inside(badge) * (rear & (car is not VAN)), _CHROME, CLEAR_COAT)
    for axle in car.axles:
        _paint_wheel(surface, car, axle)


def paint_lorry(surface: Surface, color: Float32Array) -> None:
    """Paint a lorry: a light box body with doors and a band of colour."""
    x, y, z = surface.side, surface.y, surface.z
    rear = surface.normals[:, 2] < -0.5
    surface.paint(np.ones_like(x), _BODY, 0.4)
    surface.paint(_inside(np.abs(y - 3.0) - 0.42), color, 0.5)
    surface.paint(_inside(np.abs(x - 0.6) - 0.012) * rear, _STEEL, 0.7)
    surface.paint(_inside(np.minimum(x - 0.012, 1.17 - x)) * rear, _STEEL, 0.4)
    surface.paint(_inside(y - 1.125), _BLACK, MATT)
    surface.paint(_inside(surface.rectangle(0, 1.2, 2.4, 0.07)) * rear, 1.2 * _RED, 0.5)
    lights = _inside(surface.rectangle(0.92, 0.8, 0.44, 0.14, 0.02)) * (z < 0.3)
    surface.paint(lights, _RED, CLEAR_COAT, 1.5 * _GLOW)
    surface.paint(_inside(surface.rectangle(0, 0.8, 0.52, 0.11)) * (z < 0.3), _PLATE, 0.3)
    surface.paint(((y < 1.0) & (x > 0.78) & (z > 1.05)).astype(np.float32), _RUBBER, 0.05)


def _paint_gaps(surface: Surface, car: Car, rear: Float32Array, flank: Float32Array) -> None:
    """Paint the black lower edge, and the gaps around boot and doors."""
    x, y, z = surface.side, surface.y, surface.z
    surface.paint(_inside(y - car.seam + 0.24), _BLACK, MATT)
    middle = (car.axles[0] + car.axles[1]) / 2 + 0.25
    boot = np.maximum(
        np.abs(x - car.width / 2 + 0.22) - 0.005, np.maximum(y - car.belt, car.seam - y)
    )
    surface.paint(
        _inside(np.minimum(boot, np.abs(y - car.seam) - 0.006)) * rear, 0.5 * _BLACK, MATT
    )
    for door in (car.axles[0] + 0.55, middle, car.axles[1] - 0.55):
        gap = np.maximum(np.abs(z - door) - 0.006, np.abs(y - 0.75) - 0.42)
        surface.paint(_inside(gap) * flank, 0.5 * _BLACK, MATT)
    for handle in (car.axles[0] + 0.75, middle + 0.2):
        bar = to_rounded_rectangle(z - handle, y - car.belt + 0.14, 0.22, 0.036, 0.015)
        surface.paint(_inside(bar) * flank, rgb(60, 60, 62), CLEAR_COAT)


def _paint_windows(surface: Surface, car: Car, rear: Float32Array, flank: Float32Array) -> None:
    x, y, z = surface.side, surface.y, surface.z
    low, high, half = car.rear_window
    window = np.maximum(
        x - half + 0.22 * (y - low), np.abs(y - (low + high) / 2) - (high - low) / 2
    )
    start, end, top = car.side_windows
    low = car.belt + 0.03
    sides = np.maximum(start + 0.9 * (y - low) - z, z - end + 1.6 * (y - low))
    sides = np.maximum(sides, np.maximum(low - y, y - top))
    pillar = np.abs(z - (start + end) / 2 + 0.1) - 0.045
    for glass, where in ((window, rear), (np.maximum(sides, -pillar), flank)):
        surface.paint(_inside(glass - 0.028) * where, 0.6 * _BLACK, 0.5)
        surface.paint(_inside(glass) * where, _GLASS, GLASS)


def _paint_lights(surface: Surface, car: Car, *, bright: bool) -> None:
    y, height, width = car.lights
    x = car.width / 2 - 0.04 - width / 2
    glow = _GLOW * (6.0 if bright else 1.0)
    at_rear = surface.z < 0.32
    lamp = surface.rectangle(x, y, width, height, 0.045)
    surface.paint(_inside(lamp - 0.012) * at_rear, _BLACK, 0.6)
    surface.paint(_inside(lamp) * at_rear, _RED, CLEAR_COAT, glow)
    bar = surface.rectangle(x, y + 0.18 * height, width - 0.07, 0.26 * height, 0.02)
    surface.paint(_inside(bar) * at_rear, _RED, CLEAR_COAT, 3.6 * glow)
    if width > 0.25:
        white = surface.rectangle(x - 0.2 * width, y - 0.28 * height, 0.44 * width, 0.24 * height)
        surface.paint(_inside(white) * at_rear, rgb(220, 216, 210), CLEAR_COAT)
    reflector = surface.rectangle(car.width / 2 - 0.33, car.seam - 0.155, 0.2, 0.036)
    surface.paint(_inside(reflector) * at_rear, 0.7 * _RED, CLEAR_COAT)


def _paint_plate(surface: Surface, rear: Float32Array, height: float, text: str) -> None:
    plate = surface.rectangle(0, height, 0.52, 0.114, 0.012)
    surface.paint(_inside(plate - 0.015) * rear, _BLACK, MATT)
    surface.paint(_inside(plate) * rear, _PLATE, 0.3)
    letters = np.zeros((48, 220), np.uint8)
    cv2.putText(letters, text, (8, 40), cv2.FONT_HERSHEY_DUPLEX, 1.35, 255, 3, cv2.LINE_AA)
    column = np.clip((surface.x + 0.235) / 0.47 * 220, 0, 219).astype(int)
    row = np.clip((height + 0.045 - surface.y) / 0.09 * 48, 0, 47).astype(int)
    surface.paint(_inside(plate) * rear * (letters[row, column] / 255), _INK, 0.3)


def _paint_wheel(surface: Surface, car: Car, axle: float) -> None:
    """Paint tyre and rim; the rim has five spokes."""
    up, ahead = surface.y - car.wheel, surface.z - axle
    radius = np.hypot(ahead, up)
    near = (surface.side > car.width / 2 - 0.3) & (surface.side < car.width / 2 - 0.03)
    surface.paint(_inside(radius - car.wheel - 0.012) * near, _RUBBER, MATT)
    outer = near & (surface.side > car.width / 2 - 0.1)
    spokes = ramp(0.25, 0.5, 0.5 + 0.5 * np.cos(5 * np.arctan2(up, ahead)) + 0.6 * (radius < 0.09))
    rim = np.maximum(spokes, _inside(np.abs(radius - 0.63 * car.wheel) - 0.02))
    surface.paint(_inside(radius - 0.66 * car.wheel) * outer, rgb(30, 30, 32), 0.3)
    surface.paint(_inside(radius - 0.66 * car.wheel) * outer * rim, _RIM, 0.9)


def _inside(distance: Float32Array) -> Float32Array:
    """Return 1 inside an area and 0 outside, with an edge of 4 mm."""
    return np.clip(0.5 - distance / 0.004, 0, 1).astype(np.float32)
