"""What is drawn on the frames of a video."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from vdet.pipeline.annotation import StagePictures, annotate, draw_tracks

from red_cars import CAR, COLOUR, HEIGHT, SETTINGS, WIDTH, red_finder, road
from vdet.config.lanes import LaneSettings
from vdet.detect.svm.detector import detect_still
from vdet.draw.boxes import color_of, draw_box
from vdet.geometry import Box
from vdet.lanes.camera import CalibratedCamera
from vdet.lanes.lane import Lane
from vdet.lanes.road import LaneRequest, Road, RoadFinder
from vdet.media import Frame
from vdet.pipeline.result import FrameResult
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


def seen(camera: CalibratedCamera | None) -> Road:
    finder = RoadFinder(LaneRequest(camera), LaneSettings(), WIDTH, HEIGHT)
    return finder.update(finder.observe(road(CAR)))


def result_of(
    *boxes: Box, road_seen: Road | None = None, time: Fraction = Fraction(0)
) -> FrameResult:
    tracks = tuple(Track(number, box, False) for number, box in enumerate(boxes, start=1))
    detection = detect_still(red_finder(), SETTINGS, road(CAR))
    return FrameResult(Frame(0, time, road(CAR)), detection, tracks, road_seen)


def test_without_lanes_cars_are_drawn_where_they_are() -> None:
    expected = road(CAR)
    draw_box(expected, CAR, color_of(1), "#1")
    np.testing.assert_array_equal(annotate(result_of(CAR)).image, expected)


def test_with_lanes_cars_are_drawn_where_undistortion_puts_them() -> None:
    undistorted = seen(LENS)
    assert undistorted.place(CAR) != CAR
    expected = undistorted.image.copy()
    draw_box(expected, undistorted.place(CAR), color_of(1), "#1")
    drawn = annotate(result_of(CAR, road_seen=undistorted)).image
    np.testing.assert_array_equal(drawn, expected)


def test_a_car_that_undistortion_moves_out_of_the_picture_is_not_drawn() -> None:
    undistorted = seen(LENS)
    assert undistorted.place(CORNER).area == 0
    before = undistorted.image.copy()
    np.testing.assert_array_equal(annotate(result_of(CORNER, road_seen=undistorted)).image, before)


def test_without_a_camera_cars_stay_where_they_are() -> None:
    assert seen(None).place(CAR) == CAR
    assert (seen(None).image == road(CAR)).all()


def test_the_lane_lies_under_the_boxes() -> None:
    box = Box(100, 150, 120, 60)
    with_lane = replace(seen(None), lane=LANE)
    drawn = annotate(result_of(box, road_seen=with_lane)).image
    assert (drawn[box.bottom - 1, box.x : box.right] == color_of(1)).all()
    blue, green, red = drawn[180, 160].astype(int) - road(CAR)[180, 160]
    assert green > max(blue, red)


class TestStagePictures:
    def offered(self, folder: Path, at: Fraction, *results: FrameResult) -> list[str]:
        pictures = StagePictures(folder, at, COLOUR)
        for result in results:
            pictures.offer(result)
        return sorted(path.name for path in folder.glob("*"))

    def test_are_made_of_the_first_frame_at_or_after_the_moment(self, tmp_path: Path) -> None:
        early, late = (result_of(time=Fraction(t)) for t in (1, 3))
        assert self.offered(tmp_path / "a", Fraction(2), early) == []
        assert len(self.offered(tmp_path / "b", Fraction(2), early, late)) == 5

    def test_are_made_once(self, tmp_path: Path) -> None:
        pictures = StagePictures(tmp_path, Fraction(0), COLOUR)
        pictures.offer(result_of())
        for path in tmp_path.iterdir():
            path.unlink()
        pictures.offer(result_of())
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("lane", [None, LANE])
    def test_show_the_lane_where_it_is_looked_for(self, tmp_path: Path, lane: Lane | None) -> None:
        with_road = result_of(road_seen=replace(seen(LENS), lane=lane))
        names = self.offered(tmp_path, Fraction(0), with_road)
        assert names[5:] == ["6-road.png", "7-above.png", "8-mask.png", "9-fit.png"]


class TestTracks:
    def test_only_boxes_and_their_labels_are_drawn_on(self) -> None:
        image = np.full((720, 1280, 3), 255, np.uint8)
        boxes = [Box(200, 400, 120, 90), Box(800, 420, 240, 150)]
        draw_tracks(image, [Track(n, box, False) for n, box in enumerate(boxes, start=1)])
        allowed = np.zeros(image.shape[:2], bool)
        for box in boxes:
            allowed[box.y - 32 : box.bottom, box.x : box.right] = True
            allowed[box.y + 5 : box.bottom - 5, box.x + 5 : box.right - 5] = False
        drawn = (image != 255).any(axis=2)
        assert drawn.any()
        assert not (drawn & ~allowed).any()

    def test_each_id_has_its_own_color(self) -> None:
        image = np.full((240, 320, 3), 255, np.uint8)
        draw_tracks(image, [Track(3, Box(20, 100, 50, 50), False)])
        draw_tracks(image, [Track(4, Box(200, 100, 50, 50), False)])
        assert tuple(image[149, 45]) == color_of(3)
        assert tuple(image[149, 225]) == color_of(4)

    def test_no_tracks_leave_the_picture_as_it_was(self) -> None:
        image = np.full((240, 320, 3), 255, np.uint8)
        draw_tracks(image, [])
        assert image.min() == 255
