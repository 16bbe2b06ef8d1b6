"""Distances and lanes of vehicles on drawn roads, where their places are known."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.distances import FARTHEST, RIGHT, Drive, Sample, by_true_boxes
from benchmarks.drawn_traffic import traffic_scene

from vdet.media import Picture
from vdet.synthetic import PinholeCamera, Renderer, Scene, SceneVehicle, Waypoint, true_boxes

FRAMES = 14
SETTLED = 4
"""Frame from which a lane that is found in the first ones has settled."""
DASHBOARD = PinholeCamera.dashboard(960, 540)
WIDE = PinholeCamera(1242, 375, 721, 0.46 * 375, 1.65)
VAN = PinholeCamera(960, 540, 700, 0.45 * 540, 2.2)


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


@pytest.mark.parametrize(
    ("camera", "radius", "lane"),
    [(DASHBOARD, np.inf, 1), (WIDE, np.inf, 1), (WIDE, -400.0, 0), (VAN, 250.0, 2)],
)
def test_with_the_lines_that_are_found_distances_are_right(
    camera: PinholeCamera, radius: float, lane: int
) -> None:
    scene = scene_of(camera, radius, lane)
    finder, renderer = Drive(scene).finder(), Renderer(scene)
    samples: list[Sample] = []
    pitches = []
    for index in range(FRAMES):
        vehicles = [true_box.box for true_box in true_boxes(scene, index)]
        road = finder.update(finder.observe(Picture(renderer.image(index))), vehicles)
        pitches += [road.curves.pitch] if road.curves else []
        samples += [
            sample
            for sample in by_true_boxes(scene, index, road)
            if index >= SETTLED
            and sample.truth.distance <= FARTHEST
            and not road.cuts(sample.reported.box)
        ]
    assert len(samples) > 2 * FRAMES
    known = [sample for sample in samples if sample.reported.distance is not None]
    assert len(known) >= 0.7 * len(samples)
    assert max(abs(sample.error) for sample in known) <= RIGHT
    assert np.mean([sample.reported.lane == sample.truth.lane for sample in known]) >= 0.95
    assert abs(np.mean(pitches)) < 0.001, "4 % of the distance at 40 m: vehicles bent the lines"
