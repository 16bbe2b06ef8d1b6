"""Thirty drawn crowds: how well ids hold in dense traffic. `python -m benchmarks.crowds`.

Fifteen roads are seen from a windscreen, fifteen from a pole; the network finds the vehicles.
"""

import math
from dataclasses import replace
from fractions import Fraction
from statistics import fmean

import numpy as np

from benchmarks.drawn_traffic import as_planes, follow, shown_labels, true_labels
from vdet.config.schema import Settings
from vdet.detect.detectors import load_detector
from vdet.evaluate.scores import score
from vdet.synthetic import (
    LANE_WIDTH,
    LORRY,
    PinholeCamera,
    Scene,
    SceneVehicle,
    Waypoint,
    empty_road,
    frames,
    random_body,
    random_paint,
)
from vdet.workers import limit_library_threads

SCENES = range(30)
_SECONDS = 6
_LORRIES = 0.15  # fraction of vehicles
_SPACE = 0.9, 2.5
"""Minimum and most room between two vehicles of a lane, in lengths of the one in front."""


def crowd(number: int) -> Scene:
    """Return one of the scenes: even numbers from a windscreen, odd ones from a pole."""
    rng = np.random.default_rng((7, number))
    if number % 2 == 0:
        camera, lanes, lane, own = PinholeCamera.dashboard(960, 540), 5, 3, 14.0
        first, last = -40.0, 90.0
    else:
        camera = PinholeCamera.pole(960, 540, rng.uniform(6, 12))
        lanes, lane, own = 6, int(rng.integers(1, 5)), 0.0
        first, last = 5.0, 110.0
    scene = empty_road(rng, camera, lane=lane, lanes=lanes, seed=number)
    vehicles: list[SceneVehicle] = []
    for place in range(lanes):
        is_oncoming = place < lanes // 2
        speed = rng.uniform(4, 14) * (-1 if is_oncoming else 1) - own
        lateral = (place - lane) * LANE_WIDTH
        reach = abs(speed) * _SECONDS
        ahead = first - reach
        while ahead < last + reach:
            body = LORRY if rng.random() < _LORRIES else random_body(rng)
            ahead += body.length * (1 + rng.uniform(*_SPACE))
            near = abs(lateral) < 1 and ahead < 12 and number % 2 == 0
            end = ahead + speed * _SECONDS
            if near or (lane == place and number % 2 == 0 and min(ahead, end) < 8):
                continue  # it would drive into the camera
            # It changes its speed a little half-way.
            half, heading = _SECONDS / 2, math.pi if is_oncoming else 0.0
            middle = ahead + speed * half + rng.normal(0, 0.06) * reach
            way = tuple(
                Waypoint(time, place, lateral + rng.normal(0, 0.15), heading)
                for time, place in ((0, ahead), (half, middle), (2 * half, middle + speed * half))
            )
            vehicles.append(SceneVehicle(len(vehicles) + 1, way, random_paint(rng), body))
    scene = replace(scene, speed=own, rate=Fraction(25), frames=25 * _SECONDS)
    return replace(scene, vehicles=tuple(vehicles))


def main() -> None:
    """Print the metrics of both cameras."""
    limit_library_threads()
    settings = Settings()
    model = load_detector(settings.detector)
    print("camera      scenes   F1     IDF1   HOTA   id switches   fragmentations")
    for camera, numbers in (("windscreen", SCENES[::2]), ("pole", SCENES[1::2])):
        scores = []
        for scene in map(crowd, numbers):
            results = follow(model, settings, scene, map(as_planes, frames(scene)))
            truth = true_labels(scene, range(scene.frames))
            scores.append(score(shown_labels(results), truth))
        means = (fmean(getattr(score, name) for score in scores) for name in ("f1", "idf1", "hota"))
        sums = sum(s.id_switches for s in scores), sum(s.fragmentations for s in scores)
        row = "   ".join(f"{mean:.3f}" for mean in means)
        print(f"{camera:<12}{len(scores):4}   {row}{sums[0]:12}{sums[1]:17}")


if __name__ == "__main__":
    main()
