"""Drawn traffic for the motion tracker: vehicles on a straight road, with a known truth.

In each lane the vehicles have one speed, relative to the camera; nearer ones hide farther ones.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from benchmarks.drawn_traffic import true_labels

from vdet.boxes import Boxes
from vdet.config.schema import MotionTrackerSettings
from vdet.evaluate.scores import Scores, score
from vdet.labels.label import SavedTracks
from vdet.synthetic import (
    LANE_WIDTH,
    Body,
    Carriageway,
    PinholeCamera,
    Scene,
    SceneVehicle,
    Waypoint,
    random_body,
)
from vdet.track.motion.tracker import MotionTracker
from vdet.track.track import Track

WIDTH, HEIGHT = 640, 360
SECONDS = 10
CAMERA = PinholeCamera(WIDTH, HEIGHT, focal=575, horizon=200, above_ground=1.3)


def driving(
    number: int, lane: int, ahead: float, speed: float, body: Body | None = None
) -> SceneVehicle:
    """Return a vehicle in a lane (0 is the camera's), `ahead` metres at time 0, m/s."""
    start = Waypoint(0, ahead, lane * LANE_WIDTH)
    end = Waypoint(SECONDS, ahead + speed * SECONDS, lane * LANE_WIDTH)
    return SceneVehicle(number, (start, end), color=(0, 0, 0), body=body or Body())


def random_traffic(seed: int, fastest: float) -> list[SceneVehicle]:
    """Give one or two vehicles in each of five lanes, with speeds up to `fastest` m/s."""
    rng = np.random.default_rng(seed)
    vehicles: list[SceneVehicle] = []
    for lane in (-2, -1, 0, 1, 2):
        speed = rng.uniform(-fastest, fastest) if lane else rng.uniform(-0.3, 0.3)
        ahead = rng.uniform(12, 30)
        if lane:  # it is near the camera at some time
            ahead += rng.uniform(-7, 10) - speed * SECONDS * rng.uniform(0, 1)
        for _ in range(rng.integers(1, 3)):
            vehicles.append(driving(len(vehicles) + 1, lane, ahead, speed, random_body(rng)))
            ahead += rng.uniform(12, 40)
    return vehicles


@dataclass(frozen=True, slots=True)
class Noise:
    """What a detector does wrong.

    `sides` is the standard deviation of the sides of a box, fraction of its size. `missed` is the
    fraction of vehicles that it does not see. `false` is the mean number of false detections in a
    frame; their scores go up to `surest`.
    """

    sides: float = 0.05
    missed: float = 0.1
    false: float = 0.1
    surest: float = 0.6


PERFECT = Noise(0, 0, 0)


def detect(truth: Iterable[Track], noise: Noise, rng: np.random.Generator) -> Boxes:
    """Give what a detector with such noise sees; without noise all scores are 1."""
    boxes, scores = [], []
    for vehicle in truth:
        if vehicle.ignored or rng.random() < noise.missed:
            continue
        x1, y1, x2, y2 = vehicle.box.pixels
        sizes = np.array([x2 - x1, y2 - y1] * 2)
        jitter = rng.normal(0, noise.sides, 4) if noise.sides else np.zeros(4)
        boxes.append([x1, y1, x2, y2] + jitter * sizes)
        scores.append(rng.beta(8, 1.2) if noise.sides else 1.0)
    for _ in range(rng.poisson(noise.false)):
        width = np.exp(rng.uniform(np.log(15), np.log(100)))
        left, top = rng.uniform(0, WIDTH - width), rng.uniform(175, 300)
        boxes.append(np.array([left, top, left + width, top + 0.8 * width]))
        scores.append(rng.uniform(0.1, noise.surest))
    return Boxes(np.reshape(boxes, (-1, 4)), scores)


def track_scores(
    vehicles: Sequence[SceneVehicle], rate: int, noise: Noise, seed: int = 0, *, stride: int = 1
) -> Scores:
    """Track vehicles at `rate` frames a second with the default settings, and score the tracks.

    Every `stride` frames one is searched.
    """
    scene = Scene(
        CAMERA, Carriageway(-9, 9, lines=()), vehicles=tuple(vehicles), rate=Fraction(rate),
        frames=SECONDS * rate,
    )  # fmt: skip
    truth = true_labels(scene, range(scene.frames))
    rng = np.random.default_rng(seed)
    tracker = MotionTracker(MotionTrackerSettings(), WIDTH, HEIGHT)
    shown: dict[int, list[Track]] = {}
    for number in range(scene.frames):
        time = scene.time(number)
        if number % stride:
            shown[number] = tracker.at(time)
        else:
            found = detect(truth.frames.get(number, ()), noise, rng)
            shown[number] = tracker.update(found, time)
    return score(SavedTracks(shown), truth)
