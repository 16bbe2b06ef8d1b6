"""Frames that the detector does not search: nothing is missed in them, and the boxes move on."""

from collections.abc import Sequence

import numpy as np
import pytest

from track.motion.scenes import HEIGHT, WIDTH, detections
from track.motion.traffic import Noise, random_traffic, track_scores, truth_at
from vdet.boxes import Box
from vdet.config.schema import MotionTrackerSettings
from vdet.evaluate.scores import Scores
from vdet.track.motion.tracker import MotionTracker
from vdet.track.track import Track

CAR = Box.sized(400, 400, 100, 70)
RATE = 25
DEFAULTS = MotionTrackerSettings()


def follow_strided(
    places: Sequence[Box | None], stride: int, rate: float = RATE, *, carry: bool = True
) -> list[list[Track]]:
    """Track a vehicle that is looked for in every so many frames; None where it is not seen.

    Without `carry` the other frames count as searched, and it is missed there.
    """
    tracker = MotionTracker(DEFAULTS, WIDTH, HEIGHT)
    shown = []
    for number, place in enumerate(places):
        found = [] if place is None or number % stride else [place]
        if number % stride and carry:
            shown.append(tracker.at(number / rate))
        else:
            shown.append(tracker.update(detections(found), number / rate))
    return shown


def test_what_is_not_looked_for_is_not_missed() -> None:
    long_gaps = 2 * round(DEFAULTS.coast_seconds * RATE)
    places: list[Box | None] = [CAR] * (6 * long_gaps)
    missed = follow_strided(places, long_gaps, carry=False)
    carried = follow_strided(places, long_gaps)
    assert not all(missed[2 * long_gaps :])
    assert all(carried[2 * long_gaps :])
    scores = [[tracks[0].score for tracks in shown[-2:] if tracks] for shown in (missed, carried)]
    assert min(scores[1]) > max(scores[0], default=0)


def scores_at(stride: int, seed: int) -> Scores:
    vehicles = random_traffic(seed, 8.0, fastest=12)
    clip = [truth_at(vehicles, n / RATE) for n in range(8 * RATE)]
    return track_scores(clip, RATE, Noise(), seed, stride=stride)


@pytest.mark.parametrize("seed", [1, 2])
def test_drawn_traffic_is_followed_nearly_as_well_where_few_frames_are_searched(seed: int) -> None:
    every, second, fifth = (scores_at(stride, seed) for stride in (1, 2, 5))
    assert every.f1 > 0.95
    assert second.f1 > every.f1 - 0.03
    assert fifth.f1 > every.f1 - 0.1
    assert fifth.false_tracks == 0
    assert np.isclose(second.vehicle_boxes, every.vehicle_boxes)
