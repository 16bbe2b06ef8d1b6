"""Drawn road scenes with their truth, for the demo and the tests.

Scenes are described in metres and seconds, also random ones from a seed; the same scene always
gives the same images and the same truth. Points are metres: x to the right of the camera, y up from
the ground, z ahead of the camera, measured along the road. Pixels are x to the right, y down, whole
numbers at pixel centres. Lateral positions are metres to the right of the camera. A `station` is
metres along the road from where the clip begins. The road's surface and the plants beside it repeat
every `PERIOD` metres, so a clip may have any length.

Scenes are rendered as frames and as video files. Sky, ground colours and solid lines are painted
once per scene; dashes, ground texture, plants and vehicles are drawn in each frame. A vehicle is a
solid of flat facets: the lower body is a prism, the cabin a frustum on top of it, and lights,
plate, windows and wheels are facets painted on them. Its coordinates are metres: x to the right of
its middle, y up from the ground, z ahead of its rear.
"""

import math
from collections.abc import Iterator
from dataclasses import astuple, dataclass, replace
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Box, Float32Array, Float64Array, Image
from vdet.config.schema import OutputSettings
from vdet.draw import Color
from vdet.files import staged, write_whole
from vdet.media import Frame, Picture, VideoInfo
from vdet.media.writer import VideoWriter

NEAR = 0.5
"""Metres; nothing nearer than this is drawn."""

_FRACTION_BITS = 4  # fractional bits of the coordinates given to OpenCV

PERIOD = 200.0
"""Metres after which plants and surface repeat."""
LINE_WIDTH = 0.15
"""Metres."""
LANE_WIDTH = 3.7
"""Metres."""

_YELLOW: Color = (60, 180, 225)
_PAINTS: tuple[Color, ...] = (
    (228, 228, 226), (170, 168, 165), (112, 110, 108), (34, 32, 32), (40, 34, 128), (110, 62, 34),
    (70, 84, 60), (128, 140, 150), (52, 46, 44), (150, 110, 74),
)  # fmt: skip
_VERGES: tuple[Color, ...] = ((92, 132, 150), (60, 104, 96), (100, 122, 128))

_SHADOW: Color = (34, 32, 32)
_GLASS: Color = (62, 52, 46)
_TYRE: Color = (26, 25, 25)
_RIM: Color = (150, 148, 146)
_UNDERSIDE: Color = (20, 19, 19)
_LIGHT: Color = (38, 26, 165)
_HEADLIGHT: Color = (215, 222, 222)
_PLATE: Color = (205, 208, 208)

_SILL = 0.26  # height of the lower edge of the body
_REAR_AXLE = 0.85
_WHEEL = 0.31  # radius
_HIGHEST_LIGHT = 1.15  # upper edge of the lights of a tall vehicle

STANDS = _REAR_AXLE - _WHEEL
"""Metres between its rear and the rear tyres, on which a vehicle is drawn to stand on the road."""

_Facet = tuple[Float64Array, Color]
"""A flat polygon `(n, 3)`, its corners clockwise as seen from outside, and its colour."""

_CRF = 20  # of the video; it is material to be searched, so it is finer than what is shown
_SHIFT = 61  # pixels by which the noise image is larger than a frame
_TEXEL = 0.1  # metres a pixel of the finest texture
_HALF_WIDTH = 30.0  # metres of texture to either side of the camera
_NEUTRAL = 128  # texture value that does not change the colour
_DASHES = 12.0  # metres from the start of a dash to the start of the next one
_FAR = 100.0  # metres; dashes end here
_NEAREST, _FARTHEST = 3.0, 140.0  # metres; plants nearer or farther are not drawn
_CROWN = ((1.0, 0.85), (0.7, 0.95))
"""Size and brightness of the parts of a plant. With more contrast it would look like a vehicle."""

_Level = tuple[Image, float, Float32Array, Float32Array]
"""A texture, the metres of ground that a pixel of it covers, and the columns and rows in it of
image rows at station 0."""

SMALLEST = (40, 24)
"""Minimum width and height, in pixels of a 720-row frame, of a vehicle that must be found."""

_CAR = 3  # class number in MOTChallenge
_WHITE = 255, 255, 255


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
        fixed = np.rint(outline * (1 << _FRACTION_BITS)).astype(np.int32)
        cv2.fillPoly(image, [fixed], color, cv2.LINE_AA if smooth else cv2.LINE_8, _FRACTION_BITS)


def shaded(color: Color, factor: float) -> Color:
    """Return a colour made darker (factor below 1) or lighter (above 1)."""
    blue, green, red = (min(255, max(0, round(value * factor))) for value in color)
    return blue, green, red


def mixed(color: Color, second: Color, fraction: float) -> Color:
    """Return a colour mixed with a fraction, 0 to 1, of a second one."""
    blue, green, red = (round(a + (b - a) * fraction) for a, b in zip(color, second, strict=True))
    return blue, green, red


@dataclass(frozen=True, slots=True)
class LaneLine:
    """A lane line along the road, solid or dashed."""

    lateral: float
    color: Color = (225, 230, 230)
    dash: float | None = None
    """Length of a dash, which begins every 12 m; None for a solid line."""


@dataclass(frozen=True, slots=True)
class Carriageway:
    """The paved road from `left` to `right`, and its lines."""

    left: float
    right: float
    lines: tuple[LaneLine, ...]
    asphalt: Color = (88, 84, 82)
    verge: Color = (92, 132, 150)


@dataclass(frozen=True, slots=True)
class Shadow:
    """A shadow across the road: `dappled` as under trees, or even as under a bridge."""

    station: float
    length: float
    strength: float
    dappled: bool


@dataclass(frozen=True, slots=True)
class Light:
    """Exposure, sensor noise, and shadows."""

    gain: float = 1.0
    """Exposure; 1 is normal."""
    noise: float = 2.0
    """Standard deviation of the sensor noise, grey levels."""
    sun: float = 0.0
    """Metres by which a vehicle's shadow reaches sideways, to the right if positive."""
    shadows: tuple[Shadow, ...] = ()


@dataclass(frozen=True, slots=True)
class Plant:
    """A tree or a bush beside the road."""

    station: float
    lateral: float
    width: float
    height: float
    color: Color


@dataclass(frozen=True, slots=True)
class Body:
    """The shape of a car or a lorry, in metres."""

    width: float = 1.8
    length: float = 4.6
    height: float = 1.45
    belt: float = 0.92
    """Height of the lower edge of the windows."""
    boot: float = 0.7
    """Distance from the rear to the lower edge of the rear window."""
    slope: float = 0.6
    """Distance over which the rear window rises to the roof."""


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A vehicle's position at a time: the middle of its rear is `ahead` of the camera, `lateral`.

    `heading` is where it drives, radians: 0 away from the camera, positive to the right.
    """

    time: float
    ahead: float
    lateral: float
    heading: float = 0.0


@dataclass(frozen=True, slots=True)
class SceneVehicle:
    """A car or a lorry that exists, and moves straight, from its first waypoint to its last."""

    id: int
    path: tuple[Waypoint, ...]
    color: Color
    body: Body = Body()

    def position(self, time: float) -> Waypoint | None:
        """Return where it is at `time`, or None while it does not exist."""
        points = np.array([astuple(point) for point in self.path])
        times = points[:, 0]
        if not times[0] <= time <= times[-1]:
            return None
        ahead, lateral, heading = (np.interp(time, times, column) for column in points[:, 1:].T)
        return Waypoint(time, float(ahead), float(lateral), float(heading))


@dataclass(frozen=True, slots=True)
class Scene:
    """A clip of `frames` frames at `rate` per second, from a camera that moves at `speed` m/s."""

    camera: PinholeCamera
    road: Carriageway
    light: Light = Light()
    roadside: tuple[Plant, ...] = ()
    vehicles: tuple[SceneVehicle, ...] = ()
    speed: float = 25.0
    rate: Fraction = Fraction(25)
    frames: int = 1
    seed: int = 0
    """Of textures and noise."""

    def time(self, index: int) -> float:
        """Return the time of a frame, seconds."""
        return float(index / self.rate)

    def station(self, index: int) -> float:
        """Return the camera's station at a frame, metres."""
        return self.speed * self.time(index)

    def brightness(self, station: float) -> float:
        """Return the light that falls on a vehicle at a station, 0 to 1."""
        light = 1.0
        for shadow in self.light.shadows:
            if (station - shadow.station) % PERIOD < shadow.length:
                light *= 1 - shadow.strength * (0.5 if shadow.dappled else 1.0)
        return light

    def nearest_first(self, time: float) -> list[tuple[Waypoint, SceneVehicle]]:
        """Return the vehicles that exist at a time, each with its position, the nearest first."""
        visible = [(point, v) for v in self.vehicles if (point := v.position(time))]

        def nearest(pair: tuple[Waypoint, SceneVehicle]) -> float:
            position, vehicle = pair
            return position.ahead + min(0.0, math.cos(position.heading) * vehicle.body.length)

        return sorted(visible, key=nearest)


_SHAPES: tuple[Body, ...] = (
    Body(),
    Body(length=4.2, boot=0.15, slope=0.5, height=1.48),
    Body(width=1.88, length=4.7, boot=0.12, slope=0.35, height=1.72, belt=1.04),
    Body(width=1.9, length=4.9, boot=0.06, slope=0.12, height=1.92, belt=1.12),
    Body(width=1.82, length=4.8, boot=0.1, slope=0.7, height=1.46),
)


LORRY = Body(width=2.5, length=9.0, height=3.5, belt=3.45, boot=0.05, slope=0.05)
"""A lorry with a box body."""


def demo_scene(seed: int, *, width: int = 960, height: int = 540) -> Scene:
    """Return the scene of the demo: 10 s at 25 frames a second.

    The camera drives in the left lane. Vehicle 1 drives far ahead in the same lane, vehicle 2 two
    lanes to the right. The camera overtakes vehicle 3, which leaves at the right edge. Vehicle 4
    enters at the right edge, overtakes, and hides vehicle 2 for about two seconds.
    """
    rng = np.random.default_rng(seed)
    scene = empty_road(rng, PinholeCamera.dashboard(width, height), lane=0, lanes=3, seed=seed)
    near, far = LANE_WIDTH, 2 * LANE_WIDTH
    paths = (
        (Waypoint(0, 25, 0), Waypoint(4, 29, 0.1), Waypoint(10, 26, -0.1)),
        (Waypoint(0, 20, far), Waypoint(10, 30, far)),
        (Waypoint(0, 24, near), Waypoint(2, 10, near), Waypoint(4.5, -8, near)),
        (
            *(Waypoint(3, -8, near), Waypoint(5, 7, near)),
            *(Waypoint(6.5, 13, near), Waypoint(10, 26, near)),
        ),
    )
    paints = rng.permutation(len(_PAINTS))
    vehicles = tuple(
        SceneVehicle(number, path, _PAINTS[paints[number]], random_body(rng))
        for number, path in enumerate(paths, start=1)
    )
    return replace(scene, vehicles=vehicles, frames=250)


def pole_scene(seed: int) -> Scene:
    """Return 10 s of a road seen from a pole: two lanes in each direction, two cars in each lane.

    All cars come from outside the frame, and in the end have left it or are far away.
    """
    rng = np.random.default_rng(seed)
    scene = empty_road(rng, PinholeCamera.pole(960, 540), lane=1, lanes=4, seed=seed)
    vehicles = []
    for number in range(8):
        lateral, comes = (number % 4 - 1) * LANE_WIDTH, number % 4 < 2
        start, speed = 2.4 * (number // 4) + rng.uniform(0, 0.5), rng.uniform(13, 16)
        first, last = (90.0, -10.0) if comes else (-10.0, 90.0)
        ends = (start, first), (start + 100 / speed, last)
        path = tuple(Waypoint(time, ahead, lateral, np.pi * comes) for time, ahead in ends)
        vehicles.append(SceneVehicle(number + 1, path, random_paint(rng), random_body(rng)))
    still = replace(scene, roadside=(), speed=0.0, rate=Fraction(25, 2), frames=125)
    return replace(still, vehicles=tuple(vehicles))


def busy_road(rng: np.random.Generator) -> Scene:
    """Return 40 frames of a road to train on, each with its own vehicles, two per lane.

    The camera is so fast that consecutive frames show different places.
    """
    lanes = int(rng.integers(2, 5))
    lane, seed = int(rng.integers(lanes)), int(rng.integers(2**31))
    height, curvature = rng.uniform(1.1, 1.6), rng.uniform(-1, 1) / 600
    camera = PinholeCamera(960, 320, 864.0, 120.0, height, curvature)
    road = empty_road(rng, camera, lane=lane, lanes=lanes, seed=seed)
    scene = replace(road, frames=40, speed=400.0)
    cars = [(random_paint(rng), random_body(rng)) for _ in range(50)]
    vehicles: list[SceneVehicle] = []
    for index in range(scene.frames):
        for lateral in (np.arange(lanes) - lane) * LANE_WIDTH:
            near = rng.uniform(6.5, 16) + abs(lateral)
            for ahead in (near, near + rng.uniform(8, 24)):
                position = Waypoint(scene.time(index), ahead, lateral + rng.uniform(-0.6, 0.6))
                color, body = cars[rng.integers(len(cars))]
                vehicles.append(SceneVehicle(len(vehicles) + 1, (position,), color, body))
    return replace(scene, vehicles=tuple(vehicles))


def empty_road(
    rng: np.random.Generator, camera: PinholeCamera, *, lane: int, lanes: int, seed: int
) -> Scene:
    """Return a road without vehicles, with random colours, light and roadside.

    The camera drives in the middle of lane `lane` of `lanes`, counted from 0 at the left.
    """
    left = -(lane + 0.5) * LANE_WIDTH
    right = left + lanes * LANE_WIDTH
    dashed = [LaneLine(left + number * LANE_WIDTH, dash=3.0) for number in range(1, lanes)]
    lines = (LaneLine(left, _YELLOW), *dashed, LaneLine(right))
    grey, verge = int(rng.integers(58, 120)), _VERGES[rng.integers(len(_VERGES))]
    road = Carriageway(left - 1.5, right + 2.0, lines, (grey + 4, grey, grey - 3), verge)
    light = _random_light(rng)
    sides = ((-1, left - 3), (1, right + 4)) * 28
    plants = tuple(_random_plant(rng, side, edge) for side, edge in sides)
    return Scene(camera, road, light, plants, seed=seed)


def random_body(rng: np.random.Generator) -> Body:
    """Return a saloon, hatchback, off-roader, van or coupé of a random size."""
    shape = _SHAPES[rng.integers(len(_SHAPES))]
    sides = {side: getattr(shape, side) for side in ("width", "height", "length")}
    return replace(shape, **{side: v * rng.uniform(0.96, 1.04) for side, v in sides.items()})


def random_paint(rng: np.random.Generator) -> Color:
    """Return a random colour that is usual for cars."""
    paint = np.array(_PAINTS[rng.integers(len(_PAINTS))]) + rng.integers(-12, 13, 3)
    blue, green, red = (int(value) for value in np.clip(paint, 8, 245))
    return blue, green, red


def _random_light(rng: np.random.Generator) -> Light:
    stations = np.arange(15.0, PERIOD - 20, 45.0) + rng.uniform(0, 15)
    shadows = tuple(
        Shadow(station, rng.uniform(4, 14), rng.uniform(0.25, 0.5), dappled=rng.random() < 0.7)
        for station in stations.tolist()
    )
    gain, noise, sun = rng.uniform(0.75, 1.2), rng.uniform(1.5, 4.0), rng.uniform(-0.8, 0.8)
    return Light(gain, noise, sun, shadows)


def _random_plant(rng: np.random.Generator, side: int, edge: float) -> Plant:
    """Return a tree or a bush."""
    tall = rng.random() < 0.6
    height = rng.uniform(4, 9) if tall else rng.uniform(1.0, 2.0)
    green, station = int(rng.integers(60, 110)), rng.uniform(0, PERIOD)
    lateral = edge + side * (rng.uniform(6, 28) if tall else rng.uniform(1, 12))
    width = height * (rng.uniform(0.6, 1.1) if tall else rng.uniform(1.0, 1.8))
    color = (green - int(rng.integers(10, 40)), green, green - int(rng.integers(-10, 30)))
    return Plant(station, lateral, width, height, color)


def outlines(
    vehicle: SceneVehicle, position: Waypoint, camera: PinholeCamera
) -> list[tuple[Float64Array, Color]]:
    """Return the pixels `(n, 2)` and colour of each visible facet, in painting order."""
    drawn = []
    for corners, color in _facets(vehicle.body, vehicle.color):
        outline = camera.project(beyond_near(_placed(corners, position)))
        if len(outline) and cv2.contourArea(outline.astype(np.float32), oriented=True) > 0:
            drawn.append((outline, color))
    return drawn


def draw_vehicle(image: Image, vehicle: SceneVehicle, position: Waypoint, scene: Scene) -> None:
    """Draw a vehicle and the shadow below it onto a frame."""
    half, sun = vehicle.body.width / 2, scene.light.sun
    front = vehicle.body.length - STANDS
    left, right = min(0.0, sun) - half, max(0.0, sun) + half
    shadow = _quad((left, 0, STANDS), (right, 0, STANDS), (right, 0, front), (left, 0, front))
    scene.camera.draw(image, _placed(shadow, position), _SHADOW)
    light = scene.brightness(scene.speed * position.time + position.ahead)
    for outline, color in outlines(vehicle, position, scene.camera):
        fill_outline(image, outline, shaded(color, light))


def _placed(corners: Float64Array, position: Waypoint) -> Float64Array:
    """Return corners `(n, 3)` of a vehicle in the coordinates of the camera."""
    sine, cosine = np.sin(position.heading), np.cos(position.heading)
    turn = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
    return np.asarray(corners @ turn + (position.lateral, 0.0, position.ahead))


@lru_cache(maxsize=512)
def _facets(body: Body, color: Color) -> list[_Facet]:
    """Return all facets in painting order. Of two that overlap, one is hidden."""
    facets = _underside(body) + _lower_body(body, color) + _wheels(body, color)
    return facets + _ends(body, color) + _cabin(body, color)


def _underside(body: Body) -> list[_Facet]:
    half, top = body.width / 2, _SILL + 0.05
    panels = [(-half + 0.1, half - 0.1, 0.1, _UNDERSIDE)]
    panels += [(x, x + 0.24, 0.0, _TYRE) for x in (-half + 0.04, half - 0.28)]
    return [
        (_upright(side * left, side * right, bottom, top, z), color)
        for side, z in ((-1, body.length - STANDS), (1, STANDS))  # seen from ahead, and from behind
        for left, right, bottom, color in panels
    ]


def _lower_body(body: Body, color: Color) -> list[_Facet]:
    """Extrude the outline of the rear along the vehicle."""
    half, belt = body.width / 2, body.belt
    left = [(-half + 0.06, _SILL), (-half, _SILL + 0.14), (-half, belt - 0.2), (-half + 0.1, belt)]
    outline = left + [(-x, y) for x, y in reversed(left)]
    parts = []
    for (x0, y0), (x1, y1) in pairwise(outline):
        corners = _quad((x0, y0, 0), (x0, y0, body.length), (x1, y1, body.length), (x1, y1, 0))
        upward = (x1 - x0) / np.hypot(x1 - x0, y1 - y0)
        parts.append((corners, shaded(color, 0.78 + 0.3 * upward)))
    rear, front = (_quad(*((x, y, z) for x, y in outline)) for z in (0.0, body.length))
    return [*parts, (rear, shaded(color, 0.92)), (front[::-1], shaded(color, 0.98))]


def _wheels(body: Body, color: Color) -> list[_Facet]:
    """Paint arches, tyres and rims onto both sides."""
    discs = (_WHEEL + 0.06, shaded(color, 0.3)), (_WHEEL, _TYRE), (0.62 * _WHEEL, _RIM)
    return [
        (_disc(side * (body.width / 2 + 0.005), axle, radius), painted)
        for side in (-1, 1)
        for axle in (_REAR_AXLE, body.length - 0.9)
        for radius, painted in discs
    ]


def _ends(body: Body, color: Color) -> list[_Facet]:
    """Paint bumper, boot or grille, plate and lights onto rear and front."""
    half, belt = body.width / 2, min(body.belt, _HIGHEST_LIGHT)
    rear, front, z = _SILL + 0.32, _SILL + 0.2, body.length + 0.01
    light = mixed(_LIGHT, shaded(color, 0.5), 0.2)
    panels = [
        (_upright(-half + 0.05, half - 0.05, _SILL, _SILL + 0.1, -0.01), shaded(color, 0.4)),
        (_upright(-half, half, rear, rear + 0.03, -0.01), shaded(color, 0.5)),
        (_upright(-half + 0.1, half - 0.1, belt - 0.05, belt, -0.01), shaded(color, 1.12)),
        (_upright(-0.27, 0.27, rear + 0.05, rear + 0.17, -0.02), _PLATE),
        (_upright(-half + 0.02, -half + 0.36, belt - 0.24, belt - 0.06, -0.02), light),
        (_upright(half - 0.36, half - 0.02, belt - 0.24, belt - 0.06, -0.02), light),
        (_upright(half - 0.05, -half + 0.05, _SILL, _SILL + 0.12, z), shaded(color, 0.4)),
        (_upright(half - 0.5, -half + 0.5, front, belt - 0.12, z), shaded(_GLASS, 0.6)),
        (_upright(0.26, -0.26, front, front + 0.12, z + 0.01), _PLATE),
        (_upright(half - 0.04, half - 0.44, belt - 0.28, belt - 0.1, z), _HEADLIGHT),
        (_upright(-half + 0.44, -half + 0.04, belt - 0.28, belt - 0.1, z), _HEADLIGHT),
    ]
    if body.belt > _HIGHEST_LIGHT:  # a windscreen
        panels.append((_upright(half - 0.15, -half + 0.15, 1.5, 2.5, z), _GLASS))
    return panels


def _cabin(body: Body, color: Color) -> list[_Facet]:
    """Put a frustum with windows onto the lower body."""
    low, high = body.width / 2 - 0.12, body.width / 2 - 0.3
    belt, roof = body.belt, body.height
    rear_low, rear_high = body.boot, body.boot + body.slope
    front_low = max(rear_high + 1.2, body.length - 1.3)
    front_high = max(rear_high + 0.8, front_low - 0.8)
    ends = rear_low, rear_high, front_high, front_low
    right = np.column_stack([(low, high, high, low), (belt, roof, roof, belt), ends])
    left = right * (-1, 1, 1)
    rear = np.array([left[0], left[1], right[1], right[0]])
    parts = [(np.array([left[1], left[2], right[2], right[1]]), shaded(color, 1.1))]
    for side in (left[::-1], right):
        windows = _inset(side, 0.08, 0.47), _inset(side, 0.53, 0.92)
        parts += [(side, shaded(color, 0.85)), *((glass, shaded(_GLASS, 0.8)) for glass in windows)]
    for end in (rear, np.array([right[3], right[2], left[2], left[3]])):
        parts += [(end, shaded(color, 0.95)), (_inset(end, 0.1, 0.9), _GLASS)]
    return parts


def _quad(*corners: tuple[float, float, float]) -> Float64Array:
    return np.array(corners, np.float64)


def _upright(left: float, right: float, bottom: float, top: float, z: float) -> Float64Array:
    return _quad((left, bottom, z), (left, top, z), (right, top, z), (right, bottom, z))


def _disc(x: float, axle: float, radius: float) -> Float64Array:
    """Return a wheel's circle on the side at `x`, clockwise as seen from that side."""
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False) * np.sign(x)
    y, z = _WHEEL + radius * np.sin(angles), axle + radius * np.cos(angles)
    return np.stack([np.full(16, x), np.maximum(y, 0.0), z], axis=1)[::-1]


def _inset(quad: Float64Array, left: float, right: float) -> Float64Array:
    """Return the part of a quad between two fractions of its width, less 14 % at bottom and top.

    The corners of a quad are lower left, upper left, upper right, lower right.
    """
    across, up = np.array([(left, 0.14), (left, 0.86), (right, 0.86), (right, 0.14)]).T[..., None]
    lower = quad[0] + across * (quad[3] - quad[0])
    upper = quad[1] + across * (quad[2] - quad[1])
    return np.asarray(lower + up * (upper - lower))


class Renderer:
    """Draws the frames of one scene; sky and static parts of the ground are painted once."""

    def __init__(self, scene: Scene) -> None:
        camera, road = scene.camera, scene.road
        self._scene = scene
        self._noise = _sensor_noise(scene)
        self._top = int(camera.horizon) + 2
        """The first row of the ground."""
        rows = np.arange(self._top, camera.height, dtype=np.float32)[:, None]
        distance = camera.focal * camera.above_ground / (rows - np.float32(camera.horizon))
        columns = np.arange(camera.width, dtype=np.float32) - camera.width / 2
        bend = camera.curvature * distance**2 / 2
        lateral = (columns * distance / camera.focal - bend).astype(np.float32)
        self._levels = _levels(scene, lateral, distance)
        inside = np.minimum(lateral - road.left, road.right - lateral)
        paved = np.clip(inside / (distance / camera.focal) + 0.5, 0, 1)[..., None]
        asphalt, verge = (np.array(color, np.float32) for color in (road.asphalt, road.verge))
        ground = paved * asphalt + (1 - paved) * verge
        self._background = np.concatenate([_sky(scene)[: self._top], ground]).astype(np.uint8)
        for line in road.lines:
            if line.dash is None:
                _draw_stripe(self._background, scene, line, NEAR, 6 * _FAR)

    def image(self, index: int) -> Image:
        """Return frame `index`, BGR uint8 `(H, W, 3)`."""
        scene = self._scene
        image = self._background.copy()
        self._draw_ground(image, scene.station(index))
        _draw_plants(image, scene, scene.station(index))
        for position, vehicle in reversed(scene.nearest_first(scene.time(index))):
            draw_vehicle(image, vehicle, position, scene)
        return self._expose(image, index)

    def _draw_ground(self, image: Image, station: float) -> None:
        """Draw dashes and texture over the base, as seen from a station of the camera."""
        for line in self._scene.road.lines:
            if line.dash is not None:
                for start in np.arange(-(station % _DASHES), _FAR, _DASHES).tolist():
                    if (end := start + line.dash) > NEAR:
                        _draw_stripe(image, self._scene, line, max(NEAR, start), end)
        parts = []
        for texture, texel, x, y in self._levels:
            rows = y + np.float32(station % PERIOD / texel)
            parts.append(cv2.remap(texture, x, rows, cv2.INTER_LINEAR, None, cv2.BORDER_WRAP))
        gain, ground = np.concatenate(parts), image[self._top :]
        cv2.multiply(ground, cv2.merge([gain, gain, gain]), dst=ground, scale=1 / _NEUTRAL)

    def _expose(self, image: Image, index: int) -> Image:
        """Return the image with lens blur, exposure and sensor noise."""
        soft = cv2.GaussianBlur(image, (3, 3), 0.6)
        exposed = cv2.convertScaleAbs(soft, alpha=self._scene.light.gain)
        x, y = np.random.default_rng([self._scene.seed, 4, index]).integers(0, _SHIFT, 2)
        height, width = image.shape[:2]
        noise = self._noise[y : y + height, x : x + width]
        return np.asarray(cv2.add(exposed, noise, dtype=cv2.CV_8U), dtype=np.uint8)


def frames(scene: Scene) -> Iterator[Frame]:
    """Render the frames of a scene, the first at 0 s."""
    renderer = Renderer(scene)
    for index in range(scene.frames):
        yield Frame(index, Fraction(index) / scene.rate, Picture(renderer.image(index)))


def write_clip(path: Path, scene: Scene, *, overwrite: bool = False) -> None:
    """Write a scene as an H.264 video without audio.

    Raises
    ------
    OutputError
        The file cannot be written, or its suffix is not that of a video.
    """
    camera, rate = scene.camera, scene.rate
    info = VideoInfo(path, camera.width, camera.height, rate, 1 / rate, frames=scene.frames)
    with (
        staged(path, overwrite=overwrite) as temporary,
        VideoWriter(temporary, info, OutputSettings(crf=_CRF), name=path) as writer,
    ):
        for frame in frames(scene):
            writer.write(frame)


def _sensor_noise(scene: Scene) -> npt.NDArray[np.int16]:
    """Return an image of noise, larger than a frame; each frame uses another part of it."""
    rng = np.random.default_rng([scene.seed, 5])
    shape = (scene.camera.height + _SHIFT, scene.camera.width + _SHIFT, 3)
    noise = rng.standard_normal(shape, dtype=np.float32) * np.float32(scene.light.noise)
    return np.asarray(np.rint(noise), np.int16)


def _sky(scene: Scene) -> Float64Array:
    """Return sky, clouds and hills down to the first rows of the ground, BGR `(rows, width, 3)`."""
    rng = np.random.default_rng([scene.seed, 3])
    horizon, width, unit = scene.camera.horizon, scene.camera.width, scene.camera.height / 720
    height = int(horizon) + 3

    def noise(rows: int, columns: int) -> Float64Array:
        return _enlarged(rng.standard_normal((rows, columns)), height, width)

    up = np.linspace(1, 0, height)[:, None, None]
    sky = up * np.array([168, 118, 78]) + (1 - up) * np.array([206, 186, 165])
    clouds = 0.25 * (noise(6, 10) + 0.4 * noise(18, 40) - rng.uniform(-0.5, 1.5))
    clouds = np.clip(clouds, 0, 0.7)[..., None]
    sky = (1 - clouds) * sky + clouds * 225
    for high, rough, color in ((88, 30, (94, 80, 66)), (34, 26, (44, 62, 60))):
        skyline = horizon - unit * (high + rough * (0.5 * noise(1, 8) + 0.22 * noise(1, 90)))
        hills = np.clip(np.arange(height)[:, None] - skyline, 0, 1)[..., None]
        grain = 1 + 0.16 * noise(height // 4, width // 4)[..., None]
        sky = (1 - hills) * sky + hills * grain * color
    return np.asarray(np.clip(sky, 0, 255))


def _levels(scene: Scene, lateral: Float32Array, distance: Float32Array) -> list[_Level]:
    """Return the levels of the texture that rows of the image show, the farthest rows first.

    A row has the level at which it skips no texels; those of a level are four times as large as
    those of the level before. `lateral` `(rows, columns)` and `distance` `(rows, 1)` are where on
    the ground the pixels are, metres.
    """
    step = distance[:, 0] ** 2 / (scene.camera.focal * scene.camera.above_ground)  # metres a row
    texture, texel, end = _texture(scene), _TEXEL, len(step)
    levels: list[_Level] = []
    for finest in (4 * _TEXEL, 16 * _TEXEL, np.inf):
        start = int(np.searchsorted(-step, -finest))
        if start < end:
            x = (lateral[start:end] + _HALF_WIDTH) / texel
            y = np.repeat(distance[start:end] / texel, x.shape[1], axis=1)
            levels.insert(0, (texture, texel, x, y))
        size = texture.shape[1] // 4, texture.shape[0] // 4
        texture = np.asarray(cv2.resize(texture, size, interpolation=cv2.INTER_AREA), np.uint8)
        texel, end = 4 * texel, start
    return levels


def _texture(scene: Scene) -> Image:
    """Return the brightness of the ground, uint8, 128 is neutral; `PERIOD` × 60 m at 10 cm a pixel.

    Rows are stations, columns run from 30 m left to 30 m right of the camera.
    """
    rng = np.random.default_rng([scene.seed, 1])
    rows, columns = int(PERIOD / _TEXEL), int(2 * _HALF_WIDTH / _TEXEL)

    def noise(coarse_rows: int, coarse_columns: int, high: int = rows) -> Float32Array:
        coarse = rng.standard_normal((coarse_rows, coarse_columns), dtype=np.float32)
        return _enlarged(coarse, high, columns)

    grain, patches = noise(rows, columns), noise(rows // 12, columns // 12)
    tracks = noise(1, columns // 6, 1)
    lateral = np.linspace(-_HALF_WIDTH, _HALF_WIDTH, columns)
    paved = (lateral > scene.road.left) & (lateral < scene.road.right)
    gain = 1 + np.where(paved, 0.04, 0.12) * grain + np.where(paved, 0.04, 0.14) * patches
    gain += np.where(paved, 0.03, 0.0) * tracks
    for shadow in scene.light.shadows:
        start, end = (int(s / _TEXEL) for s in (shadow.station, shadow.station + shadow.length))
        dark = patches[start:end] > 0 if shadow.dappled else np.True_
        gain[start:end] *= np.where(dark, 1 - shadow.strength, 1.0)
    return np.clip(gain * _NEUTRAL, 0, 255).astype(np.uint8)


def _enlarged(noise: npt.NDArray[Any], rows: int, columns: int) -> npt.NDArray[Any]:
    """Return smooth noise `(rows, columns)`, mean 0 and deviation about 1."""
    return np.asarray(cv2.resize(noise, (columns, rows), interpolation=cv2.INTER_CUBIC))


def _draw_stripe(image: Image, scene: Scene, line: LaneLine, start: float, end: float) -> None:
    """Draw a lane line from `start` to `end`, metres ahead.

    Its corners are 5 % apart, which is enough to follow any bend.
    """
    z = np.geomspace(start, end, 2 + int(20 * np.log(end / start)))
    x = line.lateral + np.repeat([-0.5, 0.5], len(z)) * LINE_WIDTH
    stripe = np.column_stack([x, np.zeros_like(x), np.concatenate([z, z[::-1]])])
    scene.camera.draw(image, stripe, line.color)


def _draw_plants(image: Image, scene: Scene, station: float) -> None:
    """Draw the plants beside the road as seen from a station of the camera."""
    placed = [((plant.station - station) % PERIOD, plant) for plant in scene.roadside]
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    for ahead, plant in sorted(placed, key=lambda pair: -pair[0]):
        if not _NEAREST < ahead < _FARTHEST:
            continue
        ragged = 1 + 0.12 * np.sin(7 * angles + plant.station) + 0.08 * np.sin(11 * angles)
        for size, brightness in _CROWN:
            x = plant.lateral + size * ragged * np.cos(angles) * plant.width / 2
            y = np.maximum(0, plant.height * (1 + size * ragged * np.sin(angles)) / 2)
            crown = np.column_stack([x, y, np.full_like(x, ahead)])
            scene.camera.draw(image, crown, shaded(plant.color, brightness))


@dataclass(frozen=True, slots=True)
class TrueBox:
    """The place of a vehicle in a frame, without its shadow on the ground.

    `box` bounds the part inside the frame, including what nearer vehicles hide. `hidden` is the
    fraction of this part that they hide, 0 to 1.
    """

    id: int
    box: Box
    hidden: float


def true_boxes(scene: Scene, index: int) -> tuple[TrueBox, ...]:
    """Return the vehicles that are at least partly inside frame `index`, ordered by id."""
    camera = scene.camera
    covered = np.zeros((camera.height, camera.width), np.uint8)
    boxes = []
    for position, vehicle in scene.nearest_first(scene.time(index)):
        mask = np.zeros_like(covered)
        for outline, _ in outlines(vehicle, position, camera):
            fill_outline(mask, outline, _WHITE, smooth=False)
        if inside := cv2.countNonZero(mask):
            hidden = cv2.countNonZero(mask & covered) / inside
            x, y, width, height = cv2.boundingRect(mask)
            boxes.append(TrueBox(vehicle.id, Box.sized(x, y, width, height), hidden))
        covered |= mask
    return tuple(sorted(boxes, key=lambda box: box.id))


def must_be_found(vehicle: TrueBox, frame_height: int) -> bool:
    """Return whether a vehicle must be found: it is large enough, and at most half of it is hidden.

    The smallest size is `SMALLEST` in a frame of 720 rows and grows with the frame. For a vehicle
    that the frame's edge cuts, the size of the part inside counts.
    """
    width, height = (length * frame_height / 720 for length in SMALLEST)
    large = vehicle.box.width >= width and vehicle.box.height >= height
    return large and vehicle.hidden <= 0.5


def write_truth(path: Path, scene: Scene, *, overwrite: bool = False) -> None:
    """Write the true box of each vehicle, in the columns of MOTChallenge ground truth.

    One line per box: `frame, id, left, top, width, height, flag, class, visibility`; frames and
    pixels count from 1, the class is 3 (car), the visibility is 1 - `hidden`. The flag is 1 for a
    vehicle that must be found and 0 for an ignore region (`must_be_found`).

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    lines = []
    for index in range(scene.frames):
        for vehicle in true_boxes(scene, index):
            x, y, width, height = vehicle.box.xywh
            flag = int(must_be_found(vehicle, scene.camera.height))
            box = f"{x + 1},{y + 1},{width},{height}"
            quality = f"{flag},{_CAR},{1 - vehicle.hidden:.3f}"
            lines.append(f"{index + 1},{vehicle.id},{box},{quality}\n")
    write_whole(path, "".join(lines), overwrite=overwrite)
