"""The distance and the lane of vehicles, in videos and in pictures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.drawn_traffic import lane_view, true_places

from red_cars import NullDetector
from run.red_runs import follow
from vdet.boxes import Box, Boxes
from vdet.config.camera import CameraSettings, LensSettings
from vdet.config.schema import MotionTrackerSettings, Settings
from vdet.lanes.road import Road, RoadFinder
from vdet.media import Picture
from vdet.run.pictures import PictureSearch
from vdet.run.steps import with_positions
from vdet.synthetic.camera import PinholeCamera
from vdet.synthetic.render import frames, render
from vdet.synthetic.scene import Carriageway, LaneLine, Light, Scene, SceneVehicle, Waypoint
from vdet.synthetic.truth import true_boxes
from vdet.track.track import Track

WIDTH, HEIGHT = 640, 360
AHEAD = 18.0
CAMERA = PinholeCamera.dashboard(WIDTH, HEIGHT)
LENS = LensSettings(
    size=(WIDTH, HEIGHT),
    matrix=((CAMERA.focal, 0, WIDTH / 2), (0, CAMERA.focal, HEIGHT / 2), (0, 0, 1)),
    distortion=(0, 0, 0, 0, 0),
)
SETTINGS = Settings(
    camera=CameraSettings(lens=LENS),
    lanes=lane_view(CAMERA, near=6, far=42).model_copy(update={"enabled": True}),
    tracker=MotionTrackerSettings(confirm_seconds=0.05),
)
SCENE = Scene(
    camera=CAMERA,
    road=Carriageway(-7, 7, tuple(LaneLine(x) for x in (-5.55, -1.85, 1.85, 5.55))),
    light=Light(noise=0),
    vehicles=tuple(
        SceneVehicle(number, (Waypoint(0, AHEAD, x), Waypoint(9, AHEAD, x)), color=(40, 30, 200))
        for number, x in ((1, -3.7), (2, 0.2), (3, 3.7))
    ),
    frames=8,
)


class TrueDetector(NullDetector):
    """Finds the vehicles of the scene; for the tests of what follows from boxes."""

    def search(self, picture: Picture, index: int | None) -> None:
        """Do nothing: the vehicles keep their distances."""

    def detect(self, candidates: None) -> Boxes:  # noqa: ARG002
        """Return the true boxes of the scene."""
        boxes = [true_box.box for true_box in true_boxes(SCENE, 0)]
        corners = [(box.x1, box.y1, box.x2, box.y2) for box in boxes]
        return Boxes(corners, np.full(len(corners), 0.95))

    def for_video(self, *_: object) -> "TrueDetector":
        return self


def roads() -> RoadFinder:
    return RoadFinder(None, SETTINGS.lanes, WIDTH, HEIGHT)


def check(tracks: tuple[Track, ...]) -> None:
    """Compare tracks from left to right with where the vehicles are."""
    left_to_right = sorted(tracks, key=lambda track: track.box.x1)
    assert len(left_to_right) == 3
    for track, place in zip(left_to_right, true_places(SCENE, 0), strict=True):
        assert track.distance == pytest.approx(place.distance, rel=0.1)
        assert track.lane == place.lane


def test_vehicles_of_a_video_have_their_distance_and_lane() -> None:
    found = list(follow(frames(SCENE), SETTINGS, width=WIDTH, height=HEIGHT, model=TrueDetector()))
    check(found[-1].tracks)
    assert found[-1].frame_tracks.tracks == found[-1].tracks, "all outputs get them"


def test_vehicles_of_a_picture_have_their_distance_and_lane() -> None:
    image = render(SCENE, 0)
    result = PictureSearch(TrueDetector(), SETTINGS).detect(Path("a.png"), image)
    check(result.tracks)


@pytest.fixture(scope="module")
def road() -> Road:
    finder = roads()
    return finder.update(finder.observe(Picture(render(replace(SCENE, vehicles=()), 0))))


def track_at(box: Box) -> Track:
    return Track(1, box, 0.9, state="detected")


@pytest.mark.parametrize(
    "box",
    [
        Box.sized(300, 300, 60, 60),
        Box.sized(0, 230, 60, 60),
        Box.sized(580, 230, 60, 60),
        Box.sized(300, 150, 9, 9),
    ],
)
def test_a_vehicle_whose_foot_is_not_on_the_road_in_the_frame_has_none(
    road: Road, box: Box
) -> None:
    old = replace(track_at(box), distance=1.0, lane=1)
    [track] = with_positions([old], road, 0)
    assert (track.distance, track.lane) == (None, None)
    assert replace(track, distance=1.0, lane=1) == old, "nothing else changes"
