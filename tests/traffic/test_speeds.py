"""Speeds of vehicles on a known road plane."""

from dataclasses import fields

import numpy as np
import pytest

from lanes.poles import CORNERS, HEIGHT, WIDTH, seen
from vdet.boxes import Box, Float64Array
from vdet.lanes.camera import Undistorter, fit_ground
from vdet.track.track import FrameTracks, State, Track
from vdet.traffic.counts import Counts, Event
from vdet.traffic.speeds import SpeedMeter, Speeds, with_speeds

GROUND = fit_ground(seen(CORNERS), CORNERS, Undistorter(None, WIDTH, HEIGHT))
RATE = 25


def measured(
    places: Float64Array,
    *,
    rate: float = RATE,
    noise: float = 0.0,
    low: float = 0.0,
    state: State = "detected",
    seed: int = 1,
    asked: bool = False,
) -> Speeds | None:
    """Return the speeds of a vehicle whose foot is at `places`, one each frame.

    `noise` and `low` move the lower edge of its box, as fractions of its height. `asked` asks for
    the speeds after every frame.
    """
    rng = np.random.default_rng(seed)
    meter = SpeedMeter(GROUND, WIDTH, HEIGHT)
    for index, place in enumerate(places):
        (x, y), (_, top) = seen(np.array([place, (place[0], place[1] + 6)])).tolist()
        height = y - top
        y += 0.5 + height * (low + noise * rng.standard_normal())
        box = Box(x - height / 2, y - height, x + height / 2, y)
        meter.add(FrameTracks(index, index / rate, (Track(1, box, 0.9, state),)))
        if asked:
            meter.speeds()
    return meter.speeds().get(1)


def driving(
    speed: float, start: float = 16, seconds: float = 2.5, rate: float = RATE
) -> Float64Array:
    times = np.arange(round(seconds * rate)) / rate
    return np.column_stack([np.full(len(times), 1.5), start + speed * times])


def known(speeds: Speeds | None) -> Speeds:
    assert speeds is not None
    return speeds


@pytest.mark.parametrize("speed", [3.0, 12.0, -12.0])
@pytest.mark.parametrize("rate", [8, 25, 50])
def test_a_steady_vehicle_has_its_speed_at_every_frame_rate(speed: float, rate: float) -> None:
    found = known(measured(driving(speed, 16 if speed > 0 else 46, rate=rate), rate=rate))
    assert found.speeds == pytest.approx(abs(speed), rel=0.01)
    assert found.quantile(0.5) == pytest.approx(abs(speed), rel=0.01)
    assert found.metres == pytest.approx(2.5 * abs(speed), rel=0.06)


def test_speeds_that_are_asked_for_in_the_middle_change_nothing() -> None:
    asked, alone = (known(measured(driving(12.0), asked=asked)) for asked in (True, False))
    for field in fields(Speeds):
        np.testing.assert_array_equal(getattr(asked, field.name), getattr(alone, field.name))


def test_the_speed_at_a_time_is_that_of_the_vehicle_then() -> None:
    times = np.arange(4 * RATE) / RATE
    found = known(measured(np.column_stack([0 * times, 16 + 3 * times + times**2])))
    speed, _ = found.at(2.0) or (0.0, 0.0)
    assert speed == pytest.approx(7.0, rel=0.02)
    assert found.at(9.0) is None


def test_the_median_is_over_the_way_so_waiting_does_not_lower_it() -> None:
    moves = driving(10.0, seconds=2)
    waits = np.repeat(moves[-1:], 5 * RATE, axis=0)
    found = known(measured(np.vstack([moves, waits])))
    assert found.quantile(0.5) == pytest.approx(10.0, rel=0.03)
    speed, _ = found.at(5.0) or (9.0, 9.0)
    assert speed < 0.1


def test_the_deviation_is_as_large_as_the_errors_are() -> None:
    """Of 60 noisy vehicles, nearly all are within two standard deviations, not far within."""
    off = []
    for seed in range(60):
        found = known(measured(driving(12.0), noise=0.02, low=0.02, seed=seed))
        off.append(abs(found.quantile(0.5) - 12.0) / found.deviation)
    assert np.mean(np.array(off) < 2) > 0.9
    assert np.median(off) > 0.15


def test_a_turning_vehicle_has_the_speed_of_its_middle() -> None:
    """The foot of its box is its nearest point, which moves along it as it turns."""
    angles = np.linspace(0, np.pi / 2, 50)
    middles = np.column_stack([8 - 8 * np.cos(angles), 20 + 8 * np.sin(angles)])
    length, width = 4.5, 1.8
    meter = SpeedMeter(GROUND, WIDTH, HEIGHT)
    for index, (angle, middle) in enumerate(zip(angles, middles, strict=True)):
        way = np.array([np.sin(angle), np.cos(angle)])
        side = np.array([way[1], -way[0]])
        corners = seen(np.array([
            middle + a * length / 2 * way + b * width / 2 * side for a in (-1, 1) for b in (-1, 1)
        ])) + 0.5  # fmt: skip
        (x1, top), (x2, y2) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        box = Box(x1, top - 30, x2, y2)
        meter.add(FrameTracks(index, index / RATE, (Track(1, box, 0.9, "detected"),)))
    true = 8 * np.pi / 2 / (49 / RATE)
    assert meter.speeds()[1].quantile(0.5) == pytest.approx(true, rel=0.05)


@pytest.mark.parametrize(
    ("places", "state"),
    [
        pytest.param(driving(10.0, seconds=0.4), "detected", id="too short"),
        pytest.param(driving(10.0, start=200), "detected", id="far beyond the area"),
        pytest.param(driving(10.0, start=-8, seconds=1), "detected", id="behind the camera"),
        pytest.param(driving(10.0), "predicted", id="lost"),
    ],
)
def test_what_is_not_known_has_no_speed(places: Float64Array, state: State) -> None:
    assert measured(places, state=state) is None


@pytest.mark.parametrize("back", [0.04, 2.0])
def test_a_vehicle_that_comes_back_after_long_keeps_its_speed(back: float) -> None:
    meter = SpeedMeter(GROUND, WIDTH, HEIGHT)
    for time in (*np.arange(0, 2, 0.04), *np.arange(60, 60 + back, 0.04)):
        ((x, y),) = seen(np.array([(0.0, 16 + 10 * (time % 60))])).tolist()
        box = Box(x - 20, y - 40, x + 20, y)
        meter.add(FrameTracks(round(25 * time), time, (Track(1, box, 0.9, "detected"),)))
    found = meter.speeds()[1]
    assert found.quantile(0.5) == pytest.approx(10.0, rel=0.02)
    assert found.metres == pytest.approx(18.0 if back < 1 else 36.0, rel=0.06)
    speeds = [found.at(time) for time in (1.0, 30.0, 61.0)]
    assert [speed is not None for speed in speeds] == [True, False, back > 1]


@pytest.mark.parametrize(("scale", "is_wrong"), [(1.0, False), (4.0, True)])
def test_cars_that_are_too_long_show_that_points_are_wrong(scale: float, is_wrong: bool) -> None:
    ground = fit_ground(seen(CORNERS), scale * CORNERS, Undistorter(None, WIDTH, HEIGHT))
    meter, events = SpeedMeter(ground, WIDTH, HEIGHT), []
    for number in range(5):
        events.append(Event(9.0, 225, "gate", "in", number, number, "car", 0.9))
        for index, (x, y) in enumerate(driving(12.0, 14.0 + number).tolist()):
            left, right = seen(np.array([(x - 0.9, y), (x + 0.9, y)])) + 0.5
            box = Box(left[0], left[1] - 60, right[0], left[1])
            frame = FrameTracks(index, index / RATE, (Track(number, box, 0.9, "detected", "car"),))
            meter.add(frame)
    counts = Counts(events=tuple(events), directions=(("gate", "in"),), zones=())
    text = "camera.ground: cars are 18.0 m long by these points; check their metres [ground]"
    assert with_speeds(counts, meter).warnings == (text,) * is_wrong
