"""The same scene at any frame rate gives about the same tracks."""

from functools import cache

import numpy as np
import pytest

from boxing import moved_to
from track.motion.scenes import WIDTH, detections, follow, ids, inside
from track.motion.traffic import PERFECT, SECONDS, Noise, driving, random_traffic, track_scores
from vdet.boxes import Box
from vdet.config.schema import MotionTrackerSettings
from vdet.evaluate.scores import Scores
from vdet.track.motion.tracker import MotionTracker

RATES = (5, 10, 25, 50)
CAR = Box.sized(400, 400, 100, 70)
DEFAULTS = MotionTrackerSettings()

every_rate = pytest.mark.parametrize("rate", RATES)


@every_rate
def test_a_clearly_seen_vehicle_is_shown_from_its_second_to_its_eighth_frame_on(rate: int) -> None:
    shown = follow([[], *[[(CAR, 0.9)]] * 20], rate)
    first = [bool(tracks) for tracks in shown[1:]].index(True)
    assert first >= 1
    assert first / rate <= max(0.15, 1 / rate)


@every_rate
def test_a_lost_vehicle_is_shown_for_the_same_time(rate: int) -> None:
    shown = follow([*[[CAR]] * rate, *[[]] * rate], rate)
    lost = sum(track.state == "predicted" for tracks in shown for track in tracks)
    assert DEFAULTS.coast_seconds - 1 / rate < lost / rate <= DEFAULTS.coast_seconds


@every_rate
def test_a_lost_vehicle_keeps_its_id_for_the_same_time(rate: int) -> None:
    for missed, id_ in ((0.6, 1), (1.3, 2)):
        gap: list[list[Box]] = [[]] * round(missed * rate)
        shown = follow([*[[CAR]] * rate, *gap, *[[CAR]] * rate], rate)
        assert ids(shown[-1:]) == {id_}


def test_frames_may_come_at_any_times() -> None:
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.01, 0.2, 100))
    tracker = MotionTracker(DEFAULTS, WIDTH, 720)
    for number, time in enumerate(times):
        place = inside(moved_to(CAR, round(100 + 70 * time), 400))
        tracks = tracker.update(detections([place]), float(time))
        if number > 20:
            (track,) = tracks
            assert (track.id, track.box.iou(place) > 0.9) == (1, True)


@pytest.mark.parametrize(("gap", "id_"), [(0.8, 1), (10.0, 2), (1e6, 2)])
def test_a_vehicle_keeps_its_id_through_a_short_gap_in_the_video(gap: float, id_: int) -> None:
    tracker = MotionTracker(DEFAULTS, WIDTH, 720)
    for n in range(20):
        tracker.update(detections([CAR]), n / 25)
    for n in range(20):
        tracks = tracker.update(detections([CAR]), 0.8 + gap + n / 25)
    assert [track.id for track in tracks] == [id_]


OVERTAKING = (
    driving(1, lane=0, ahead=25, speed=0.2),
    driving(2, lane=1, ahead=32, speed=-2),
    driving(3, lane=-1, ahead=8, speed=3),
    driving(4, lane=2, ahead=12, speed=2),
)


@every_rate
def test_perfect_detections_give_each_vehicle_one_id(rate: int) -> None:
    scores = track_scores(OVERTAKING, rate, PERFECT)
    assert (scores.tracks, scores.id_switches, scores.delays.count(None)) == (4, 0, 0)
    assert scores.precision == 1
    assert scores.recall > 1 - 2.5 / (SECONDS * min(rate, 10))
    assert scores.mean_iou > 0.9


@cache
def noisy_traffic(seed: int, rate: int, stride: int = 1) -> Scores:
    return track_scores(random_traffic(seed, fastest=12), rate, Noise(), seed, stride=stride)


@pytest.mark.parametrize("seed", [2, 3])
@pytest.mark.parametrize(
    ("rate", "stride", "loss"),
    [(5, 1, 0.1), (10, 1, 0.1), (50, 1, 0.1), (25, 2, 0.03), (25, 5, 0.1)],
)
def test_traffic_is_followed_alike_at_other_rates_and_where_few_frames_are_searched(
    rate: int, stride: int, loss: float, seed: int
) -> None:
    usual, other = noisy_traffic(seed, 25), noisy_traffic(seed, rate, stride)
    assert usual.f1 > 0.95
    assert other.f1 > usual.f1 - loss
    assert other.mota > usual.mota - 0.1
    assert other.false_tracks == 0
    assert rate != 25 or other.vehicle_boxes == usual.vehicle_boxes


@every_rate
def test_many_weak_false_detections_do_not_become_tracks(rate: int) -> None:
    noise = Noise(sides=0.03, missed=0.03, false=2.0, surest=0.4)
    scores = track_scores(OVERTAKING, rate, noise)
    assert scores.false_tracks == 0
    assert scores.id_switches == 0
    assert scores.f1 > 0.93
    shown_after = [(delay or 0) / rate for delay in scores.delays]
    assert max(shown_after) <= max(0.4, 3 / rate)
