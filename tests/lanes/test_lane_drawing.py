"""The lane drawn into frames, and the stage pictures."""

from dataclasses import replace

import numpy as np
import pytest

from vdet.config.lanes import LaneSettings
from vdet.lanes.drawing import draw_lane, lane_text
from vdet.lanes.lane import Lane
from vdet.lanes.road import LaneRequest, RoadFinder
from vdet.media.images import Image

LANE = Lane(
    curvature=-1 / 800,
    radius=800.0,
    offset=-0.25,
    width=3.7,
    left=np.array([[300.0, 650.0], [450.0, 550.0], [580.0, 460.0]]),
    right=np.array([[1000.0, 650.0], [830.0, 550.0], [690.0, 460.0]]),
)


@pytest.fixture
def frame() -> Image:
    return np.full((720, 1280, 3), 100, np.uint8)


def test_the_area_between_the_lines_is_tinted(frame: Image) -> None:
    draw_lane(frame, LANE)
    blue, green, red = frame[600, 640].tolist()
    assert green > blue
    assert green > red


def test_the_road_beside_the_lane_does_not_change(frame: Image) -> None:
    draw_lane(frame, LANE)
    assert (frame[460:, :280] == 100).all()
    assert (frame[460:, 1020:] == 100).all()


def test_only_the_visible_part_of_a_lane_is_drawn() -> None:
    small = np.full((480, 640, 3), 100, np.uint8)
    draw_lane(small, LANE)
    assert (small != 100).any()


def test_the_text_describes_the_bend_and_the_place_of_the_camera() -> None:
    assert lane_text(LANE) == (
        "lane 3.7 m wide, bends left, radius 800 m",
        "0.25 m left of its middle",
    )
    other = replace(LANE, curvature=1 / 9000, radius=None, offset=0.1)
    assert lane_text(other) == ("lane 3.7 m wide, straight", "0.10 m right of its middle")


@pytest.mark.parametrize("lane", [LANE, None])
def test_every_stage_has_a_picture_with_and_without_a_lane(frame: Image, lane: Lane | None) -> None:
    finder = RoadFinder(LaneRequest(), LaneSettings(), 1280, 720)
    pictures = replace(finder.update(finder.observe(frame)), lane=lane).pictures()
    assert list(pictures) == ["road", "above", "mask", "fit"]
    assert pictures["road"].shape == frame.shape
    assert pictures["above"].shape == pictures["mask"].shape == pictures["fit"].shape
    assert (pictures["fit"] != pictures["above"]).any() == (lane is not None)
    assert (frame == 100).all()
