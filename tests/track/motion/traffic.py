"""Drawn traffic for the motion tracker: boxes of vehicles on a flat road, with a known truth.

The camera looks along the road, 1.3 m above it. In each lane the vehicles have one speed, relative
to the camera; nearer ones hide farther ones.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from track.motion.scenes import HEIGHT, WIDTH
from vdet.boxes import Box, Boxes, Float64Array, coverage
from vdet.config.schema import MotionTrackerSettings
from vdet.evaluate.scores import Scores, score
from vdet.labels.label import NO_ID, SavedTracks
from vdet.track.motion.tracker import MotionTracker
from vdet.track.track import Track

_FOCAL = 1150.0
_HORIZON = 400.0
_CAMERA_HEIGHT = 1.3
_LANE_WIDTH = 3.7


@dataclass(frozen=True, slots=True)
class TrueVehicle:
    """A vehicle in one frame: its visible box `(4,)` and the fraction that another one hides."""

    id: int
    box: Float64Array
    hidden: float

    @property
    def counts(self) -> bool:
        """Whether a tracker has to show it: large enough, and at least half of it visible."""
        width, height = self.box[2:] - self.box[:2]
        return self.hidden <= 0.5 and width >= 40 and height >= 24


@dataclass(frozen=True, slots=True)
class RoadVehicle:
    """A vehicle that drives in lane `lane` (0 is the camera's), metres and seconds.

    `ahead` is its distance at time 0, `speed` how fast that grows.
    """

    lane: int
    ahead: float
    speed: float
    width: float = 1.9
    height: float = 1.6

    def box_at(self, time: float) -> Float64Array | None:
        """Return its box in the picture; None where it is too far or behind the camera."""
        distance = self.ahead + self.speed * time
        if not 3 < distance < 90:
            return None
        scale = _FOCAL / distance
        left = WIDTH / 2 + scale * (self.lane * _LANE_WIDTH - self.width / 2)
        top = _HORIZON + scale * (_CAMERA_HEIGHT - self.height)
        near = np.clip([left, top], 0, (WIDTH, HEIGHT))
        far = np.clip([left + scale * self.width, top + scale * self.height], 0, (WIDTH, HEIGHT))
        return np.concatenate([near, far]) if (far - near > 8).all() else None


def random_traffic(seed: int, seconds: float, fastest: float) -> list[RoadVehicle]:
    """Give one or two vehicles in each of five lanes, with speeds up to `fastest` m/s."""
    rng = np.random.default_rng(seed)
    vehicles = []
    for lane in (-2, -1, 0, 1, 2):
        speed = rng.uniform(-fastest, fastest) if lane else rng.uniform(-0.3, 0.3)
        ahead = rng.uniform(12, 30)
        if lane:  # it is near the camera at some time
            ahead += rng.uniform(-7, 10) - speed * seconds * rng.uniform(0, 1)
        for _ in range(rng.integers(1, 3)):
            size = rng.uniform(1.7, 2.2), rng.uniform(1.4, 2.4)
            vehicles.append(RoadVehicle(lane, ahead, speed, *size))
            ahead += rng.uniform(12, 40)
    return vehicles


def truth_at(vehicles: Sequence[RoadVehicle], time: float) -> list[TrueVehicle]:
    """Return the vehicles in the picture, nearest first; ids count from 1 in the order given."""
    numbered = sorted(
        enumerate(vehicles, start=1), key=lambda vehicle: vehicle[1].ahead + vehicle[1].speed * time
    )
    found: list[TrueVehicle] = []
    for number, vehicle in numbered:
        box = vehicle.box_at(time)
        if box is not None:
            nearer = np.reshape([item.box for item in found], (-1, 4))
            hidden = float(coverage(box[np.newaxis], nearer).max(initial=0))
            found.append(TrueVehicle(number, box, hidden))
    return found


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


def detect(truth: Iterable[TrueVehicle], noise: Noise, rng: np.random.Generator) -> Boxes:
    """Give what a detector with such noise sees; without noise all scores are 1."""
    boxes, scores = [], []
    for vehicle in truth:
        missed = noise.missed + (0.5 * vehicle.hidden if noise.missed else 0)
        if vehicle.hidden > 0.6 or rng.random() < missed or vehicle.box[2] - vehicle.box[0] < 24:
            continue
        near, size = vehicle.box[:2], vehicle.box[2:] - vehicle.box[:2]
        jitter = rng.normal(0, noise.sides, 4) if noise.sides else np.zeros(4)
        boxes.append([*(near + jitter[:2] * size), *(near + size + jitter[2:] * size)])
        scores.append(rng.beta(8, 1.2) if noise.sides else 1.0)
    for _ in range(rng.poisson(noise.false)):
        width = np.exp(rng.uniform(np.log(30), np.log(200)))
        left, top = rng.uniform(0, WIDTH - width), rng.uniform(350, 600)
        boxes.append([left, top, left + width, top + 0.8 * width])
        scores.append(rng.uniform(0.1, noise.surest))
    return Boxes(np.reshape(boxes, (-1, 4)), scores)


def track_scores(
    clip: Sequence[Sequence[TrueVehicle]],
    rate: float,
    noise: Noise,
    seed: int = 0,
    *,
    stride: int = 1,
) -> Scores:
    """Track a clip of `rate` frames a second with the default settings, and score the tracks.

    Every `stride` frames one is searched.
    """
    rng = np.random.default_rng(seed)
    tracker = MotionTracker(MotionTrackerSettings(), WIDTH, HEIGHT)
    true, shown = dict[int, list[Track]](), dict[int, list[Track]]()
    for number, vehicles in enumerate(clip, start=1):
        true[number] = [
            Track(
                *(vehicle.id if vehicle.counts else NO_ID, Box.of(vehicle.box.tolist()), 1.0),
                state="detected",
                ignored=not vehicle.counts,
            )
            for vehicle in vehicles
        ]
        if (number - 1) % stride:
            shown[number] = tracker.at(number / rate)
        else:
            shown[number] = tracker.update(detect(vehicles, noise, rng), number / rate)
    return score(SavedTracks(shown), SavedTracks(true))
