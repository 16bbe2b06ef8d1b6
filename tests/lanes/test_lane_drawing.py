"""A lane in JSON, drawn into frames, and in the pictures of the stages."""

from dataclasses import replace

import numpy as np

from vdet.lanes.road import Lane, draw_lane

LANE = Lane(
    curvature=-1 / 812.34567,
    radius=812.34567,
    offset=-0.25449,
    width=3.70049,
    left=np.array([[300.04, 650.06], [450.0, 550.0], [580.0, 460.0]]),
    right=np.array([[1000.0, 650.0], [830.0, 550.0], [690.0, 460.0]]),
)
STRAIGHT = replace(LANE, curvature=1 / 9000, radius=None, offset=0.1)


def test_a_record_has_millimetres_and_tenths_of_pixels() -> None:
    record = {
        "radius": 812.346,
        "offset": -0.254,
        "width": 3.7,
        "left": [[300.0, 650.1], [450.0, 550.0], [580.0, 460.0]],
        "right": [[1000.0, 650.0], [830.0, 550.0], [690.0, 460.0]],
    }
    assert LANE.record() == record
    assert STRAIGHT.record() == record | {"radius": None, "offset": 0.1}


def test_area_and_lines_are_drawn_and_nothing_beside_them() -> None:
    frame = np.full((720, 1280, 3), 100, np.uint8)
    draw_lane(frame, LANE)
    blue, green, red = frame[600, 640].tolist()
    assert green > max(blue, red)
    assert frame[550, [450, 830], 2].min() > 150
    assert (frame[460:, :280] == 100).all()
    assert (frame[460:, 1020:] == 100).all()
    assert (frame[:120, :700] != 100).any(), "the text"
    assert (frame[130:440] == 100).all()
