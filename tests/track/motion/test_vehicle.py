import numpy as np
import pytest

from vdet.config.schema import MotionTrackerSettings
from vdet.track.motion.history import SCORE_TIME
from vdet.track.motion.vehicle import LONGEST_LOOK, Look, Observation, Vehicle

SETTINGS = MotionTrackerSettings(
    decay=0.2,
    confirm_seconds=0.12,
    coast_seconds=0.22,
    keep_id_seconds=0.42,
    keep_hidden_id_seconds=2.02,
)
SIZE = (1000, 500)
FRAME = 0.04


def observation(x: float = 400, width: float = 100, score: float = 1.0) -> Observation:
    return Observation(np.array([x, 200, x + width, 200 + width / 2]), score)


def seen(
    frames: int, *, dx: float = 0, growth: float = 1, score: float = 1.0, seconds: float = FRAME
) -> Vehicle:
    """Give a vehicle after so many frames with a detection."""
    vehicle = Vehicle(observation(score=score), Look(0, seconds, SIZE), SETTINGS)
    for n in range(1, frames):
        vehicle.predict(seconds)
        found = observation(400 + n * dx, 100 * growth**n, score)
        vehicle.see(found, Look(n * seconds, seconds, SIZE))
    return vehicle


def missed(vehicle: Vehicle, frames: int, seconds: float = FRAME) -> Vehicle:
    for _ in range(frames):
        vehicle.predict(seconds)
        vehicle.miss(Look(0, seconds, SIZE))
    return vehicle


# Evidence


def test_a_single_frame_does_not_confirm_a_vehicle_however_long_it_lasts() -> None:
    assert [seen(frames, seconds=0.5).confirmed for frames in (1, 2)] == [False, True]
    assert SETTINGS.confirm_seconds > LONGEST_LOOK


# Time without a detection


def test_a_carried_vehicle_keeps_its_velocity_and_a_lost_one_comes_to_rest() -> None:
    vehicle = seen(40, dx=5)
    velocity = vehicle.state.mean[0, 1]
    assert velocity == pytest.approx(5 / FRAME, abs=2.5)
    assert missed(vehicle, 5).state.mean[0, 1] == pytest.approx(velocity)
    assert abs(missed(vehicle, 60).state.mean[0, 1]) < 0.1 * velocity


# Score


@pytest.mark.parametrize("rate", [5, 10, 25, 50])
def test_older_detections_count_less_at_the_same_pace_at_any_frame_rate(rate: int) -> None:
    vehicle = seen(10 * rate, score=1.0, seconds=1 / rate)
    for _ in range(rate):
        vehicle.see(observation(score=0.5), Look(0, 1 / rate, SIZE))
    assert vehicle.scores.value == pytest.approx(0.5 + 0.5 * np.exp(-1 / SCORE_TIME), abs=1e-3)
