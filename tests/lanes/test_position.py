"""Where vehicles are on the road: metres and lanes from the pixels at which they stand."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.drawn_traffic import lane_view
from hypothesis import given
from hypothesis import strategies as st

from lanes import chessboards
from lanes.roads import make_road, settings_for
from vdet.boxes import Box
from vdet.lanes.camera import TopView, Undistorter
from vdet.lanes.road import LaneCurves, Road, RoadFinder, RoadPosition, position_on_road
from vdet.media import Picture
from vdet.run.steps import with_positions
from vdet.synthetic import PinholeCamera, Renderer
from vdet.track.track import Track

CAMERA = PinholeCamera.dashboard(1280, 720)
STRAIGHT = LaneCurves(bend=0, heading=0, left=-1.85, right=1.85, pitch=0)
FAR = 42.0


def pixel_of(
    distance: float, lateral: float, camera: PinholeCamera = CAMERA
) -> tuple[float, float]:
    """Return where the camera sees a point of the road."""
    [[x, y]] = camera.project(np.array([[lateral, 0.0, distance]])).tolist()
    return x, y


def place(foot: tuple[float, float], curves: LaneCurves = STRAIGHT) -> RoadPosition | None:
    view = TopView(lane_view(CAMERA, near=6, far=FAR), CAMERA.width, CAMERA.height)
    return position_on_road(foot, curves, view)


@given(
    distance=st.floats(4, 50),
    lateral=st.floats(-9, 9),
    radius=st.sampled_from([np.inf, 1000, -400, 200]),
    heading=st.floats(-0.02, 0.02),
    shift=st.floats(-1.2, 1.2),
    pitch=st.floats(-0.004, 0.004),
    focal=st.floats(0.9, 2.5),
    height=st.floats(0.9, 3.0),
    width=st.floats(3.0, 3.9),
)
def test_a_point_on_a_known_road_gets_its_metres_and_its_lane(
    *,
    distance: float,
    lateral: float,
    radius: float,
    heading: float,
    shift: float,
    pitch: float,
    focal: float,
    height: float,
    width: float,
) -> None:
    camera = PinholeCamera(1280, 720, focal * 720, 330, height, curvature=1 / radius)
    view = TopView(lane_view(camera, near=20, far=FAR), 1280, 720)
    curves = LaneCurves(0.5 / radius, heading, shift - width / 2, shift + width / 2, pitch)
    pitched = replace(camera, horizon=330 + pitch * camera.focal * height)
    foot = pixel_of(distance, lateral + heading * distance, pitched)
    position = position_on_road(foot, curves, view)
    assert position is not None
    assert position.distance == pytest.approx(distance, rel=1e-3)
    fraction = (lateral - shift) / width
    if abs(fraction - np.floor(fraction) - 0.5) > 0.01:  # not on a line
        assert position.lane == (round(fraction) if abs(fraction) < 3.5 else None)


def test_where_a_row_is_worth_too_many_metres_the_distance_is_not_known() -> None:
    small = PinholeCamera.dashboard(160, 90)
    view = TopView(lane_view(small, near=6, far=FAR), small.width, small.height)
    feet = [(80, small.horizon + rows) for rows in (10.5, 9.5)]
    positions = [position_on_road(foot, STRAIGHT, view) for foot in feet]
    assert [position is not None for position in positions] == [True, False]


@pytest.fixture(scope="module")
def road() -> Road:
    """A bend of 600 m radius, without a lens."""
    scene = make_road(curvature=1 / 600, size=(640, 480), frames=1)
    finder = RoadFinder(None, settings_for(scene.camera), 640, 480)
    return finder.update(finder.observe(Picture(Renderer(scene).image(0))))


def test_a_foot_is_at_the_edge_of_a_pixel_as_boxes_are(road: Road) -> None:
    assert road.curves is not None
    pixel = pixel_of(30, 0, PinholeCamera.dashboard(640, 480, 1 / 600))
    position = road.position((pixel[0] + 0.5, pixel[1] + 0.5))
    assert position == position_on_road(pixel, road.curves, road.top_view)
    assert position is not None
    assert position.distance == pytest.approx(30, rel=0.05)
    assert position.lane == 0


def test_feet_are_undistorted(road: Road) -> None:
    lens = Undistorter(chessboards.CAMERA, 640, 480)
    [[x, y]] = lens.points(np.array([[560.0, 400.0]])).tolist()
    assert abs(y - 400) > 5
    found = replace(road, undistorter=lens).position((560.5, 400.5))
    assert found == road.position((x + 0.5, y + 0.5))


@pytest.mark.parametrize(
    ("box", "cut"),
    [
        (Box.sized(100, 300, 80, 60), False),
        (Box.sized(100, 0, 80, 60), False),  # above, the lower edge is whole
        (Box.sized(2, 300, 80, 60), True),
        (Box.sized(5, 300, 80, 60), False),
        (Box.sized(560, 300, 80, 60), True),
        (Box.sized(100, 420, 80, 60), True),
    ],
)
def test_the_edges_beside_and_below_cut_boxes(road: Road, box: Box, *, cut: bool) -> None:
    assert road.cuts(box) is cut


@pytest.mark.parametrize(
    "box",
    [
        Box.sized(300, 420, 60, 60),
        Box.sized(0, 310, 60, 60),
        Box.sized(580, 310, 60, 60),
        Box.sized(300, 190, 9, 9),
    ],
    ids=["below", "left", "right", "above the horizon"],
)
def test_a_vehicle_whose_foot_is_not_on_the_road_in_the_frame_has_no_place(
    road: Road, box: Box
) -> None:
    old = Track(1, box, 0.9, state="detected", distance=1.0, lane=1)
    [track] = with_positions([old], road, 0)
    assert track == replace(old, distance=None, lane=None)
