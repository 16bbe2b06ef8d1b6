"""The road plane from traffic: two streams that cross, or one and the focal length."""

import math

import numpy as np
import pytest

from lanes.poles import ABOVE, FOCAL, HEIGHT, WIDTH, seen
from vdet.boxes import Float64Array
from vdet.errors import ConfigError
from vdet.lanes.camera import Undistorter
from vdet.lanes.ground import Ground, fit_ground
from vdet.lanes.vanishing import TrafficPlane, traffic_plane
from vdet.polygons import Segment

SIZE = WIDTH, HEIGHT
LANES = (-5.0, -1.7, 1.7, 5.0)


def stream(turned: float, *, bent: bool = False) -> list[Float64Array]:
    """Return the paths of vehicles in four lanes of a road, in pixels that tremble a little."""
    rng = np.random.default_rng(round(100 * abs(turned)))
    turn = np.array([(np.cos(turned), -np.sin(turned)), (np.sin(turned), np.cos(turned))])
    ahead = np.linspace(-12, 12, 30)
    paths = []
    for lane in LANES:
        aside = lane + (ahead**2 / 40 if bent else 0 * ahead)
        pixels = seen(np.column_stack([aside, ahead]) @ turn.T + (0, 26))
        paths.append(pixels + rng.normal(0, 0.5, pixels.shape))
    return paths


def length(start: tuple[float, float], end: tuple[float, float]) -> tuple[Segment, float]:
    """Return a known length between two places on the road."""
    (first, last), metres = seen(np.array([start, end])).tolist(), math.dist(start, end)
    return ((first[0], first[1]), (last[0], last[1])), metres


def ground(plane: TrafficPlane) -> Ground:
    return fit_ground(plane.pixels, plane.metres, Undistorter(None, *SIZE))


def check(plane: TrafficPlane) -> None:
    assert plane.focal == pytest.approx(FOCAL, rel=0.03)
    assert plane.above_ground == pytest.approx(ABOVE, rel=0.03)
    places = ground(plane).place(seen(np.array([(0.0, 20.0), (0.0, 30.0), (4.0, 25.0)])) + 0.5)
    ways = np.hypot(*(places[1:] - places[0]).T)
    assert ways == pytest.approx([10.0, np.hypot(4, 5)], rel=0.03)


@pytest.mark.parametrize("turned", [0.3, 0.8])
def test_two_streams_that_cross_at_a_right_angle(turned: float) -> None:
    paths = stream(turned) + stream(turned - np.pi / 2)
    check(traffic_plane(paths, length((0, 20), (3, 24)), SIZE))


def test_one_stream_and_the_focal_length() -> None:
    check(traffic_plane(stream(0.3), length((0, 20), (3, 24)), SIZE, FOCAL))


def test_vehicles_that_turn_do_not_matter() -> None:
    paths = stream(0.3) + stream(0.3 - np.pi / 2) + stream(0.6, bent=True)
    check(traffic_plane(paths, length((0, 20), (3, 24)), SIZE))


@pytest.mark.parametrize(
    ("paths", "message"),
    [
        ([], "0 vehicles drive straight on"),
        (stream(0.3), "only one stream of vehicles drives straight on; give four points"),
        (stream(-0.3) + stream(0.3), "do not cross at a right angle; give four points"),
    ],
)
def test_traffic_that_gives_no_plane_is_refused_in_words(
    paths: list[Float64Array], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        traffic_plane(paths, length((0, 20), (3, 24)), SIZE)


def test_a_length_above_the_horizon_is_refused() -> None:
    paths = stream(0.3) + stream(0.3 - np.pi / 2)
    with pytest.raises(ConfigError, match="reaches above the horizon"):
        traffic_plane(paths, (((100.0, 10.0), (400.0, 500.0)), 5.0), SIZE)
