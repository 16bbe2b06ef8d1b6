"""A calibrated camera at other frame sizes, and undistortion of frames and boxes."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.boxes import Box
from vdet.errors import ConfigError
from vdet.lanes.camera import CalibratedCamera, Undistorter
from vdet.media.images import Image

CAMERA = CalibratedCamera(
    640, 480, (560.0, 558.0), (322.0, 236.0), (-0.25, 0.06, 0.0005, -0.0004, 0.0), 0.5
)


def test_scaling_to_twice_the_size_doubles_all_lengths() -> None:
    scaled = CAMERA.scaled_to(1280, 960)
    assert scaled.focal == (1120, 1116)
    assert scaled.center == (644.5, 472.5)  # scaled about the frame's corner
    assert scaled.distortion == CAMERA.distortion
    assert (scaled.width, scaled.height, scaled.rms) == (1280, 960, 1.0)


def test_scaling_accepts_an_aspect_ratio_that_differs_by_rounding() -> None:
    camera = CalibratedCamera(1280, 720, (1150, 1150), (640, 360), (0, 0, 0, 0, 0), 1)
    assert camera.scaled_to(854, 480).width == 854


@pytest.mark.parametrize("size", [(640, 360), (480, 640), (660, 480)])
def test_scaling_to_another_aspect_ratio_is_refused(size: tuple[int, int]) -> None:
    with pytest.raises(ConfigError, match=r"calibrated for 640×480 .* another aspect ratio"):
        CAMERA.scaled_to(*size)


@pytest.fixture(scope="module")
def undistorter() -> Undistorter:
    return Undistorter(CAMERA, 640, 480)


def marked(box: Box) -> Image:
    image = np.zeros((480, 640, 3), np.uint8)
    box.cut(image)[:] = 255
    return image


def extent(image: Image) -> Box:
    """Return the box around the pixels that are at least half white."""
    x, y, width, height = cv2.boundingRect((image[..., 0] > 127).astype(np.uint8))
    return Box.sized(x, y, width, height)


def test_lines_bent_by_the_lens_become_straight(undistorter: Undistorter) -> None:
    for row in (20.0, 460.0):
        ideal = np.column_stack([np.linspace(60, 580, 30), np.full(30, row)])
        rays = np.column_stack([ideal, np.ones(30)]) @ np.linalg.inv(CAMERA.matrix).T
        seen, _ = cv2.projectPoints(
            rays, np.zeros(3), np.zeros(3), CAMERA.matrix, np.array(CAMERA.distortion)
        )
        image = np.zeros((480, 640, 3), np.uint8)
        points = np.rint(seen[:, 0] * 16).astype(np.int32)
        cv2.polylines(image, [points], False, (255, 255, 255), 3, cv2.LINE_AA, 4)
        line = undistorter.image(image)[..., 0].astype(float)
        rows = (line[:, 70:570] * np.arange(480)[:, None]).sum(axis=0) / line[:, 70:570].sum(axis=0)
        assert np.ptp(seen[:, 0, 1]) > 8
        assert np.abs(rows - row).max() < 1


EDGE_BOXES = [
    Box.sized(90, 60, 60, 50),
    Box.sized(480, 40, 80, 60),
    Box.sized(70, 380, 90, 50),
    Box.sized(510, 360, 60, 60),
]


@pytest.mark.parametrize("box", [*EDGE_BOXES, Box.sized(300, 220, 40, 40)])
def test_an_undistorted_box_encloses_the_same_content(undistorter: Undistorter, box: Box) -> None:
    seen = extent(undistorter.image(marked(box)))
    assert undistorter.box(box).iou(seen) > 0.94


def test_a_box_is_clipped_to_the_frame(undistorter: Undistorter) -> None:
    moved = undistorter.box(Box.sized(0, 0, 640, 480))
    assert moved == Box.sized(0, 0, 640, 480)


def test_a_box_outside_the_undistorted_frame_has_no_area(undistorter: Undistorter) -> None:
    assert undistorter.box(Box.sized(0, 0, 12, 12)).area == 0


@given(
    x=st.integers(0, 600),
    y=st.integers(0, 440),
    width=st.integers(1, 40),
    height=st.integers(1, 40),
)
def test_an_undistorted_box_holds_all_points_of_the_box(
    x: int, y: int, width: int, height: int
) -> None:
    undistorter = Undistorter(CAMERA, 640, 480)
    box = undistorter.box(Box.sized(x, y, width, height))
    columns, rows = np.meshgrid(np.arange(x, x + width), np.arange(y, y + height))
    points = undistorter.points(np.column_stack([columns.ravel(), rows.ravel()]).astype(float))
    inside = ((points >= 0) & (points <= (639, 479))).all(axis=1)
    for point in points[inside]:
        assert box.x1 - 1 <= point[0] <= box.x2
        assert box.y1 - 1 <= point[1] <= box.y2


def test_a_frame_of_another_size_is_undistorted_in_the_same_way(undistorter: Undistorter) -> None:
    double = Undistorter(CAMERA, 1280, 960)
    small = undistorter.points(np.array([[100.0, 80.0]]))
    large = double.points(np.array([[200.5, 160.5]]))
    assert (large + 0.5) / 2 - 0.5 == pytest.approx(small)
