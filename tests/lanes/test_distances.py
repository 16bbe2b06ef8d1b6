"""Distances and lanes of vehicles on drawn roads, where their places are known."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from benchmarks.drawn_traffic import lane_view, traffic_scene, true_places

from vdet.lanes.road import Road, RoadFinder
from vdet.media import Picture
from vdet.synthetic.camera import PinholeCamera
from vdet.synthetic.render import Renderer
from vdet.synthetic.scene import Scene, SceneVehicle, Waypoint
from vdet.synthetic.truth import must_be_found, true_boxes

FRAMES = 14
SETTLED = 4
"""Frame from which a lane that is found in the first ones has settled."""
MOST = 40.0
"""Metres up to which distances must be right."""
CAMERAS = {
    "dashboard": PinholeCamera.dashboard(960, 540),
    "wide": PinholeCamera(1242, 375, 721, 0.46 * 375, 1.65),
    "van": PinholeCamera(960, 540, 700, 0.45 * 540, 2.2),
    "long": PinholeCamera(1280, 720, 1800, 0.5 * 720, 1.3),
}


@dataclass(frozen=True)
class Placed:
    """A vehicle up to 40 m ahead that is whole in the frame, and where it was found."""

    error: float | None
    """Relative error of the distance."""
    lane_is_right: bool


def scene_of(camera: PinholeCamera, radius: float, lane: int) -> Scene:
    """Draw a near and a far car in each of three lanes; they drive off."""
    camera = replace(camera, curvature=1 / radius)
    scene = traffic_scene(camera, lane=lane, lanes=3, frames=FRAMES, seed=8)
    return replace(scene, vehicles=tuple(driving_off(vehicle) for vehicle in scene.vehicles))


def driving_off(vehicle: SceneVehicle) -> SceneVehicle:
    lateral = vehicle.path[0].lateral
    near = vehicle.id % 2 == 1
    start, end = (13 + abs(lateral), 22 + abs(lateral)) if near else (28 + abs(lateral), 44)
    last = vehicle.path[-1].time
    return replace(vehicle, path=(Waypoint(0, start, lateral), Waypoint(last, end, lateral)))


def placed_in(scene: Scene, index: int, road: Road) -> Iterable[Placed]:
    places = {place.id: place for place in true_places(scene, index)}
    for each in true_boxes(scene, index):
        place = places[each.id]
        wanted = must_be_found(each, scene.camera.height) and place.distance <= MOST
        if wanted and not road.cuts(each.box):
            foot = (each.box.center[0], float(each.box.y2))
            position = road.position(foot)
            error = position.distance / place.distance - 1 if position else None
            yield Placed(error, position is not None and position.lane == place.lane)


def finder_of(scene: Scene) -> RoadFinder:
    camera = scene.camera
    nearest = camera.focal * camera.above_ground / (0.97 * camera.height - camera.horizon)
    view = lane_view(camera, near=max(6.0, nearest), far=42)
    return RoadFinder(None, view, camera.width, camera.height)


def check(placed: list[Placed], *, known: float) -> None:
    errors = [each.error for each in placed if each.error is not None]
    assert len(errors) >= known * len(placed)
    assert max(map(abs, errors)) <= 0.1
    assert np.mean([each.lane_is_right for each in placed if each.error is not None]) >= 0.95


@pytest.mark.parametrize(
    ("name", "radius", "lane"),
    [("dashboard", np.inf, 1), ("wide", np.inf, 1), ("wide", -400.0, 0), ("van", 250.0, 2)],
)
def test_with_the_lines_that_are_found_distances_are_right(
    name: str, radius: float, lane: int
) -> None:
    scene = scene_of(CAMERAS[name], radius, lane)
    finder, renderer = finder_of(scene), Renderer(scene)
    placed: list[Placed] = []
    pitches = []
    for index in range(FRAMES):
        vehicles = [each.box for each in true_boxes(scene, index)]
        road = finder.update(finder.observe(Picture(renderer.image(index))), vehicles)
        placed += placed_in(scene, index, road) if index >= SETTLED else []
        pitches += [road.curves.pitch] if road.curves else []
    assert len(placed) > 2 * FRAMES
    check(placed, known=0.7)
    assert abs(np.mean(pitches)) < 0.001, "4 % of the distance at 40 m: vehicles bent the lines"
