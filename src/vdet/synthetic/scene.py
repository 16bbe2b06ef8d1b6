"""Descriptions of road scenes in metres and seconds, also random ones from a seed.

The same scene always gives the same images and the same truth. Points are metres: x to the right of
the camera, y up from the ground, z ahead of the camera, measured along the road. Pixels are x to
the right, y down, whole numbers at pixel centres. Lateral positions are metres to the right of the
camera. A `station` is metres along the road from where the clip begins. The road's surface and the
plants beside it repeat every `PERIOD` metres, so a clip may have any length.
"""

import math
from dataclasses import astuple, dataclass, replace
from fractions import Fraction

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


PERIOD = 200.0
"""Metres after which plants and surface repeat."""
LINE_WIDTH = 0.15
"""Metres."""
LANE_WIDTH = 3.7
"""Metres."""


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
    """The shape of a car or a lorry, in metres; `vdet.synthetic.render` draws its parts."""

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


_YELLOW: Color = (60, 180, 225)
_PAINTS: tuple[Color, ...] = (
    (228, 228, 226), (170, 168, 165), (112, 110, 108), (34, 32, 32), (40, 34, 128), (110, 62, 34),
    (70, 84, 60), (128, 140, 150), (52, 46, 44), (150, 110, 74),
)  # fmt: skip
_VERGES: tuple[Color, ...] = ((92, 132, 150), (60, 104, 96), (100, 122, 128))
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
