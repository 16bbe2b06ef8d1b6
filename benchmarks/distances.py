"""Errors of the distance and the lane of vehicles, on drawn roads where their places are known.

`lane` has the true boxes, and the lines that are found in the drawn frames; `tracks` the boxes that
the detector and the tracker show (in a third of the scenes). `guess` is `lane` without a calibrated
camera: the focal length is from an angle of view that is 4° off, the lane is taken as 3.5 m wide
though it is 3.7 m, and the four points of a frame are read 2 pixels off (a few scenes).
"""

import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice, pairwise, product

import numpy as np

from benchmarks.drawn_traffic import TruePlace, follow, lane_view, traffic_scene, true_places
from vdet.boxes import Image
from vdet.config.loading import find_config, load_settings
from vdet.config.schema import LaneSettings, Settings
from vdet.detect.detectors import load_detector
from vdet.evaluate.results import table
from vdet.lanes.road import Road, RoadFinder
from vdet.media import Frame, Picture
from vdet.run.steps import LaneStep, with_positions
from vdet.synthetic import (
    PinholeCamera,
    Renderer,
    Scene,
    SceneVehicle,
    Waypoint,
    must_be_found,
    true_boxes,
)
from vdet.track.track import Track

FRAMES = 100
COUNTED = range(15, FRAMES, 2)
"""Frames that are counted; before them, the lane and the tracks begin."""
CAMERAS = (
    PinholeCamera.dashboard(1280, 720),
    PinholeCamera.dashboard(960, 540),
    PinholeCamera(1242, 375, 721, 0.46 * 375, 1.65),
    PinholeCamera(1920, 1080, 1500, 0.45 * 1080, 1.4),
    PinholeCamera(640, 360, 560, 0.52 * 360, 1.3),
    PinholeCamera(1280, 720, 900, 0.45 * 720, 2.2),
    PinholeCamera(1280, 720, 1800, 0.5 * 720, 1.3),
)
RADII = (np.inf, 800.0, -400.0, 250.0)
PITCH = (0, 2, 4, 5, 3, 0, -3, -4, -2)
"""Rows of 720 by which the horizon of a camera that pitches lies lower, for two frames each."""
EDGES = (0, 10, 20, 30, 40, 55)
"""Ranges of the true distance, metres."""
FARTHEST = 40
GUESSED_WIDTH = 3.5
READ_ERROR = 2.0
"""Pixels."""
RIGHT = 0.1
"""Largest error of a distance that counts as right, fraction of it."""
MIN_IOU = 0.5
"""Of a shown box with the vehicle whose place it is compared with."""


@dataclass(frozen=True)
class Drive:
    """A scene, whether its camera pitches, and a guess of what the camera sees of the road."""

    scene: Scene
    pitches: bool = False
    guess: LaneSettings | None = None

    def at(self, index: int) -> Scene:
        """Return the scene as the camera sees it in a frame."""
        camera = self.scene.camera
        rows = PITCH[index // 2 % len(PITCH)] * camera.height / 720 if self.pitches else 0
        return replace(self.scene, camera=replace(camera, horizon=camera.horizon + rows))

    def images(self) -> Iterator[Image]:
        """Draw the frames."""
        renderer = Renderer(self.scene)
        for index in range(FRAMES):
            drawn = Renderer(self.at(index)) if self.pitches else renderer
            yield drawn.image(index)

    def finder(self) -> RoadFinder:
        """Return the lane finder, set to the road from 6 m, or the nearest seen, to 42 m."""
        camera = self.scene.camera
        nearest = camera.focal * camera.above_ground / (0.97 * camera.height - camera.horizon)
        view = self.guess or lane_view(camera, near=max(6.0, nearest), far=42.0)
        return RoadFinder(None, view, camera.width, camera.height)


def guessed_view(camera: PinholeCamera, angle: float, seed: int) -> LaneSettings:
    """Return settings of the lane finder as a user would guess them: see `guess` above.

    `angle` is the error of the angle of view, degrees; `seed` is that of the points.
    """
    size = np.array((camera.width, camera.height))
    points = np.array(lane_view(camera, near=7.0, far=42.0).points) * size
    points[:, 0] += np.random.default_rng(seed).choice([-READ_ERROR, READ_ERROR], 4)
    half_angle = np.arctan(camera.width / 2 / camera.focal) + np.radians(angle) / 2
    focal = camera.width / 2 / np.tan(half_angle)
    near, far = points[1, 0] - points[0, 0], points[2, 0] - points[3, 0]
    metres = GUESSED_WIDTH, focal * GUESSED_WIDTH * (1 / far - 1 / near)
    return LaneSettings.model_validate({"points": (points / size).tolist(), "metres": metres})


@dataclass(frozen=True)
class Sample:
    """A vehicle in a frame, and the track that was reported."""

    truth: TruePlace
    reported: Track

    @property
    def error(self) -> float:
        """Relative error of the distance."""
        assert self.reported.distance is not None
        return self.reported.distance / self.truth.distance - 1


def main() -> None:
    """Run the steps, and print a table of each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.distances", description=__doc__)
    parser.add_argument("steps", nargs="*", help="lane, tracks (default: both), or guess")
    parser.add_argument("-c", "--config", default="default", help="of the detector: svm, seed")
    options = parser.parse_args()
    settings = load_settings([find_config(options.config)])
    for step in options.steps or ("lane", "tracks"):
        if step == "lane":
            print_table(step, chain.from_iterable(map(found_lines, drives())))
        elif step == "tracks":
            print_table(step, shown_boxes(islice(drives(), 0, None, 3), settings))
        else:
            for angle in (-4.0, 0.0, 4.0):
                print_table(f"{angle:+.0f}°", chain.from_iterable(map(found_lines, guesses(angle))))


def drives() -> Iterator[Drive]:
    """Give the scenes: each camera on each road, and cameras that pitch."""
    for number, (camera, radius) in enumerate(product(CAMERAS, RADII)):
        yield Drive(scene_of(camera, radius, number))
    for number, radius in enumerate((np.inf, 500.0)):
        yield Drive(scene_of(CAMERAS[number], radius, 101 + number), pitches=True)


def guesses(angle: float) -> Iterator[Drive]:
    """Give scenes of the dashboard camera on a straight road and in a bend."""
    for seed, (number, radius) in product(range(4), enumerate((np.inf, 800.0))):
        scene = scene_of(CAMERAS[0], radius, number + 2 * seed)
        yield Drive(scene, guess=guessed_view(scene.camera, angle, seed))


def scene_of(camera: PinholeCamera, radius: float, seed: int) -> Scene:
    """Return a road with three lanes, a near and a far car in each; they drive off or come near."""
    bent = replace(camera, curvature=1 / radius)
    scene = traffic_scene(bent, lane=seed % 3, lanes=3, frames=FRAMES, seed=seed)
    return replace(
        scene, vehicles=tuple(moving(vehicle, off=seed % 2 == 0) for vehicle in scene.vehicles)
    )


def moving(vehicle: SceneVehicle, *, off: bool) -> SceneVehicle:
    """Give a car of `traffic_scene` another path: between 6 and 26 m, or between 27 and 55 m."""
    last, lateral = vehicle.path[-1].time, vehicle.path[0].lateral
    near = vehicle.id % 2 == 1
    ends = (6 + 0.6 * abs(lateral), 26.0) if near else (27 + abs(lateral), 55.0)
    start, end = ends if off else reversed(ends)
    return replace(vehicle, path=(Waypoint(0, start, lateral), Waypoint(last, end, lateral)))


def found_lines(drive: Drive) -> Iterator[Sample]:
    """Place the true boxes by the lines that are found."""
    finder = drive.finder()
    for index, image in enumerate(drive.images()):
        scene = drive.at(index)
        vehicles = [true_box.box for true_box in true_boxes(scene, index)]
        road = finder.update(finder.observe(Picture(image)), vehicles)
        if index in COUNTED:
            yield from by_true_boxes(scene, index, road)


def by_true_boxes(scene: Scene, index: int, road: Road) -> Iterator[Sample]:
    """Give the vehicles that must be found."""
    places = true_places(scene, index)
    for true_box in true_boxes(scene, index):
        if must_be_found(true_box, scene.camera.height):
            [track] = with_positions([Track(true_box.id, true_box.box, 1.0, "detected")], road, 0.0)
            yield Sample(places[true_box.id], track)


def shown_boxes(drives: Iterable[Drive], settings: Settings) -> Iterator[Sample]:
    """Place the boxes that a detector and a tracker show, by the lines that are found."""
    model = load_detector(settings.detector)
    for drive in drives:
        rate, lanes = drive.scene.rate, LaneStep(drive.finder(), settings.detector.tyre_height)
        clip = (Frame(n, n / rate, Picture(image)) for n, image in enumerate(drive.images()))
        for result in follow(model, settings, drive.scene, clip, lanes):
            index = result.frame.index
            if index in COUNTED:
                yield from _matched(drive.at(index), index, result.tracks)


def _matched(scene: Scene, index: int, tracks: Sequence[Track]) -> Iterator[Sample]:
    places = true_places(scene, index)
    boxes = true_boxes(scene, index)
    for track in tracks:
        best = max(boxes, key=lambda box: box.box.iou(track.box))
        counts = must_be_found(best, scene.camera.height)
        if counts and best.box.iou(track.box) > MIN_IOU:
            yield Sample(places[best.id], track)


def print_table(name: str, samples: Iterable[Sample]) -> None:
    """Print a row for each range of the distance, and one for all up to `FARTHEST`."""
    rows, every = [], list(samples)
    for low, high in (*pairwise(EDGES), (0, FARTHEST)):
        inside = [sample for sample in every if low < sample.truth.distance <= high]
        known = [sample for sample in inside if sample.reported.distance is not None]
        if known:
            errors = np.array([sample.error for sample in known])
            lanes = np.mean([sample.reported.lane == sample.truth.lane for sample in known])
            row = f"{low}–{high}", str(len(inside)), f"{1 - len(known) / len(inside):.0%}"
            quantile, near = np.quantile(abs(errors), 0.95), (abs(errors) <= RIGHT).mean()
            shares = f"{errors.mean():+.1%}", f"{quantile:.1%}", f"{near:.1%}", f"{lanes:.1%}"
            rows.append((*row, *shares))
    headings = f"{name}: metres", "boxes", "none", "mean", "95 %", "within 10 %", "lane right"
    print("\n".join(table(headings, rows)))


if __name__ == "__main__":
    main()
