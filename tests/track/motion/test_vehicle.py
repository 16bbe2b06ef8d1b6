import numpy as np
import pytest

from vdet.config.schema import MotionSettings
from vdet.track.motion.vehicle import Sighting, Vehicle

SETTINGS = MotionSettings(leak=0.2, needed=3.0, carried=5, remembered=10, remembered_hidden=50)
SIZE = (1000, 500)


def sighting(x: float = 400, width: float = 100, clearness: float = 1.0) -> Sighting:
    return Sighting(np.array([x, 200, width, width / 2]), clearness)


def seen(frames: int, *, dx: float = 0, growth: float = 1, clearness: float = 1.0) -> Vehicle:
    """Give a vehicle after so many frames with a region."""
    vehicle = Vehicle.new(sighting(clearness=clearness), SETTINGS)
    for n in range(1, frames):
        vehicle.predict(SETTINGS)
        vehicle.see(sighting(400 + n * dx, 100 * growth**n, clearness), SIZE, SETTINGS)
    return vehicle


def missed(vehicle: Vehicle, frames: int) -> Vehicle:
    for _ in range(frames):
        vehicle.predict(SETTINGS)
        vehicle.miss(SETTINGS)
    return vehicle


def test_a_vehicle_is_confirmed_by_evidence_above_the_leak() -> None:
    assert [seen(frames).confirmed for frames in (3, 4)] == [False, True]
    assert [seen(frames, clearness=0.5).confirmed for frames in (9, 11)] == [False, True]


def test_an_unconfirmed_vehicle_is_over_when_its_evidence_has_leaked_away() -> None:
    assert [missed(seen(1), frames).is_over(SETTINGS) for frames in (3, 5)] == [False, True]


def test_a_confirmed_one_is_over_when_it_is_no_longer_remembered() -> None:
    assert [missed(seen(9), frames).is_over(SETTINGS) for frames in (10, 11)] == [False, True]


def test_frames_behind_another_vehicle_are_counted_by_themselves() -> None:
    vehicle = missed(seen(9), 40)
    vehicle.hidden_misses = 30
    assert not vehicle.is_over(SETTINGS)
    vehicle.hidden_misses = 29
    assert vehicle.is_over(SETTINGS)


def test_a_vehicle_is_present_as_long_as_it_is_carried() -> None:
    assert [missed(seen(9), n).is_present(SETTINGS) for n in (0, 5, 6)] == [True, True, False]


def test_a_region_ends_the_misses() -> None:
    vehicle = missed(seen(9), 8)
    vehicle.see(sighting(), SIZE, SETTINGS)
    assert (vehicle.misses, vehicle.is_present(SETTINGS)) == (0, True)


def test_a_carried_vehicle_keeps_its_velocity_and_a_lost_one_comes_to_rest() -> None:
    vehicle = seen(40, dx=5)
    velocity = vehicle.state.mean[0, 1]
    assert velocity == pytest.approx(5, abs=0.1)
    assert missed(vehicle, 5).state.mean[0, 1] == velocity
    assert abs(missed(vehicle, 60).state.mean[0, 1]) < 0.5


def test_an_unseen_vehicle_soon_stops_growing() -> None:
    vehicle = seen(40, growth=1.02)
    width = vehicle.state.box[2]
    assert width < missed(vehicle, 100).state.box[2] < 1.25 * width
