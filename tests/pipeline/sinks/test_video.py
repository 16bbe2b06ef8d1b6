"""What is drawn on the frames of a video, and on still pictures."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.red_runs import result_of
from red_cars import CAR, HEIGHT, WIDTH, road
from vdet.config.lanes import LaneSettings
from vdet.draw.boxes import color_of, draw_box
from vdet.geometry import Box
from vdet.lanes.camera import CalibratedCamera
from vdet.lanes.lane import Lane
from vdet.lanes.road import LaneRequest, Road, RoadFinder
from vdet.media.images import Image
from vdet.pipeline.sinks.video import annotate
from vdet.track.track import Track

LENS = CalibratedCamera(WIDTH, HEIGHT, (240, 240), (160, 120), (-0.35, 0.1, 0.0, 0.0, 0.0), 0.4)
CORNER = Box(0, 0, 12, 12)
LANE = Lane(
    curvature=0.0,
    radius=None,
    offset=0.0,
    width=3.7,
    left=np.array([[40.0, 220.0], [140.0, 140.0]]),
    right=np.array([[280.0, 220.0], [180.0, 140.0]]),
)


def road_seen(camera: CalibratedCamera | None) -> Road:
    finder = RoadFinder(LaneRequest(camera), LaneSettings(), WIDTH, HEIGHT)
    return finder.update(finder.observe(road(CAR)))


def test_without_lanes_vehicles_are_drawn_where_they_are() -> None:
    expected = road(CAR)
    draw_box(expected, CAR, color_of(1), "#1")
    np.testing.assert_array_equal(annotate(result_of(CAR), scores=False), expected)


def test_scores_stand_beside_the_ids_where_they_are_asked_for() -> None:
    expected = road(CAR)
    draw_box(expected, CAR, color_of(1), "#1 0.90")
    np.testing.assert_array_equal(annotate(result_of(CAR), scores=True), expected)


def test_predicted_vehicles_are_drawn_dashed() -> None:
    seen, predicted = (Track(1, CAR, 0.9, predicted=flag) for flag in (False, True))
    expected = road(CAR)
    draw_box(expected, CAR, color_of(1), "#1", dashed=True)
    dashed = annotate(result_of(predicted), scores=False)
    np.testing.assert_array_equal(dashed, expected)
    solid = annotate(result_of(seen), scores=False)
    lower = np.s_[CAR.bottom - 1, CAR.x : CAR.right]
    drawn, gaps = (solid[lower] == color_of(1)).all(1), (dashed[lower] != solid[lower]).any(1)
    assert drawn.all()
    assert 0.2 < gaps.mean() < 0.8


def test_with_lanes_vehicles_are_drawn_where_undistortion_puts_them() -> None:
    undistorted = road_seen(LENS)
    assert undistorted.place(CAR) != CAR
    expected = undistorted.image.copy()
    draw_box(expected, undistorted.place(CAR), color_of(1), "#1")
    drawn = annotate(result_of(CAR, found=undistorted), scores=False)
    np.testing.assert_array_equal(drawn, expected)


def test_a_vehicle_that_undistortion_moves_out_of_the_picture_is_not_drawn() -> None:
    undistorted = road_seen(LENS)
    assert undistorted.place(CORNER).area == 0
    drawn = annotate(result_of(CORNER, found=undistorted), scores=False)
    np.testing.assert_array_equal(drawn, undistorted.image)


def test_without_a_camera_vehicles_stay_where_they_are() -> None:
    assert road_seen(None).place(CAR) == CAR
    assert (road_seen(None).image == road(CAR)).all()


def test_the_frames_of_the_result_are_not_drawn_on() -> None:
    with_lane = replace(road_seen(LENS), lane=LANE)
    undistorted = with_lane.image.copy()
    for found in (None, with_lane):
        result = result_of(CAR, found=found)
        annotate(result, scores=True)
        np.testing.assert_array_equal(result.frame.image, road(CAR))
    np.testing.assert_array_equal(with_lane.image, undistorted)


def test_the_lane_lies_under_the_boxes() -> None:
    box = Box(100, 150, 120, 60)
    with_lane = replace(road_seen(None), lane=LANE)
    drawn = annotate(result_of(box, found=with_lane), scores=False)
    assert (drawn[box.bottom - 1, box.x : box.right] == color_of(1)).all()
    blue, green, red = drawn[180, 160].astype(int) - road(CAR)[180, 160]
    assert green > max(blue, red)


def white(width: int, height: int) -> Image:
    return np.full((height, width, 3), 255, np.uint8)


def test_only_boxes_and_their_labels_are_drawn_on() -> None:
    boxes = [Box(200, 400, 120, 90), Box(800, 420, 240, 150)]
    image = annotate(result_of(*boxes, image=white(1280, 720)), scores=False)
    allowed = np.zeros(image.shape[:2], bool)
    for box in boxes:
        allowed[box.y - 32 : box.bottom, box.x : box.right] = True
        allowed[box.y + 5 : box.bottom - 5, box.x + 5 : box.right - 5] = False
    drawn = (image != 255).any(axis=2)
    assert drawn.any()
    assert not (drawn & ~allowed).any()


def test_each_id_has_its_own_color() -> None:
    result = result_of(Box(20, 100, 50, 50), Box(200, 100, 50, 50), image=white(320, 240))
    three, four = (replace(track, id=track.id + 2) for track in result.tracks)
    image = annotate(replace(result, tracks=(three, four)), scores=False)
    assert tuple(image[149, 45]) == color_of(3)
    assert tuple(image[149, 225]) == color_of(4)


@pytest.mark.parametrize("scores", [False, True])
def test_no_tracks_leave_the_picture_as_it_was(scores: bool) -> None:
    assert annotate(result_of(image=white(320, 240)), scores=scores).min() == 255
