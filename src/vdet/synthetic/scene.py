"""The description of a road scene: plain values in metres and seconds.

The same scene always gives the same images and the same truth. Lateral positions are metres to
the right of the camera. A `station` is metres along the road from where the clip begins. The road's
surface and the plants beside it repeat every `PERIOD` metres, so a clip may have any length.
"""

import math
from dataclasses import astuple, dataclass
from fractions import Fraction

import numpy as np

from vdet.draw.boxes import Color
from vdet.synthetic.camera import PinholeCamera

PERIOD = 200.0
"""Metres after which plants and surface repeat."""
LINE_WIDTH = 0.15
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
    """The shape of a car or a lorry, in metres; `vdet.synthetic.vehicle` draws its parts."""

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
    """A car or a lorry. It exists from its first to its last waypoint, straight between."""

    id: int
    path: tuple[Waypoint, ...]
    color: Color
    body: Body = Body()

    def position(self, time: float) -> Waypoint | None:
        """Return where it is at `time`, or None while it does not exist."""
        times, *places = zip(*map(astuple, self.path), strict=True)
        if not times[0] <= time <= times[-1]:
            return None
        return Waypoint(time, *(float(np.interp(time, times, place)) for place in places))


@dataclass(frozen=True, slots=True)
class Scene:
    """A clip of `frames` frames at `rate` a second, from a camera that moves at `speed` m/s."""

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
        """Return the light on a vehicle at a station, 0 to 1."""
        light = 1.0
        for shadow in self.light.shadows:
            if (station - shadow.station) % PERIOD < shadow.length:
                light *= 1 - shadow.strength * (0.5 if shadow.dappled else 1.0)
        return light

    def nearest_first(self, time: float) -> list[tuple[Waypoint, SceneVehicle]]:
        """Return the vehicles that exist at a time, each with its position, the nearest first."""
        placed = [(place, v) for v in self.vehicles if (place := v.position(time))]

        def nearest(pair: tuple[Waypoint, SceneVehicle]) -> float:
            place, vehicle = pair
            return place.ahead + min(0.0, math.cos(place.heading) * vehicle.body.length)

        return sorted(placed, key=nearest)
