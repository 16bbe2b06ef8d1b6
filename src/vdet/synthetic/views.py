"""Frames of busy roads, of which patches are cut."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from vdet.geometry import Box
from vdet.media.images import Image
from vdet.synthetic.camera import Camera
from vdet.synthetic.render import Renderer
from vdet.synthetic.scene import PERIOD, Scene, Vehicle, Waypoint
from vdet.synthetic.truth import TrueBox, truth
from vdet.synthetic.worlds import LANE_WIDTH, empty_road, random_body, random_paint

_FRAMES = 40  # taken of each road
_SPEED = 400.0  # m/s, so that one frame sees other things than the last
_CARS = 50  # different cars on each road
_OBJECTS = 8  # most objects named of a frame


@dataclass(frozen=True, slots=True)
class View:
    """A rendered frame, the vehicles in it, and the boxes of some things beside the road."""

    image: Image
    vehicles: tuple[TrueBox, ...]
    objects: tuple[Box, ...]


def views(rng: np.random.Generator) -> Iterator[View]:
    """Render frames of ever new roads, without end."""
    while True:
        scene = _busy_road(rng)
        renderer = Renderer(scene)
        for index in range(scene.frames):
            image = _as_recorded(renderer.image(index), rng)
            yield View(image, truth(scene, index), _objects(scene, index))


def _as_recorded(image: Image, rng: np.random.Generator) -> Image:
    """Return a frame with the losses of compression; a detector never sees one without them."""
    quality = int(rng.integers(30, 95))
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR_BGR), np.uint8)


def _busy_road(rng: np.random.Generator) -> Scene:
    """Return a road on which every frame has vehicles of its own, two to a lane."""
    lanes = int(rng.integers(2, 5))
    lane = int(rng.integers(lanes))
    seed = int(rng.integers(2**31))
    camera = Camera(
        width=960,
        height=320,
        focal=864.0,
        horizon=120.0,
        above_ground=float(rng.uniform(1.1, 1.6)),
        curvature=float(rng.uniform(-1, 1) / 600),
    )
    road = empty_road(rng, camera, lane=lane, lanes=lanes, seed=seed)
    scene = replace(road, frames=_FRAMES, speed=_SPEED)
    cars = [(random_paint(rng), random_body(rng)) for _ in range(_CARS)]
    vehicles: list[Vehicle] = []
    for index in range(_FRAMES):
        for lateral in (np.arange(lanes) - lane) * LANE_WIDTH:
            near = rng.uniform(6.5, 16) + abs(lateral)
            for ahead in (near, near + rng.uniform(8, 24)):
                place = Waypoint(scene.time(index), ahead, lateral + rng.uniform(-0.6, 0.6))
                color, body = cars[rng.integers(len(cars))]
                vehicles.append(Vehicle(len(vehicles) + 1, (place,), color, body))
    return replace(scene, vehicles=tuple(vehicles))


def _objects(scene: Scene, index: int) -> tuple[Box, ...]:
    """Return the boxes of some things beside the road."""
    station = scene.station(index)
    boxes = []
    for item in scene.roadside:
        ahead = (item.station - station) % PERIOD
        if 8 < ahead < 70:
            left, right = item.lateral - item.width / 2, item.lateral + item.width / 2
            corners = np.array([[left, item.height, ahead], [right, 0.0, ahead]])
            (x0, y0), (x1, y1) = scene.camera.project(corners)
            boxes.append(Box(round(x0), round(y0), round(x1 - x0), round(y1 - y0)))
    inside = [b for b in boxes if b.clipped(scene.camera.width, scene.camera.height) == b]
    return tuple(inside[:_OBJECTS])
