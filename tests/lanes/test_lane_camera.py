"""A camera for other frame sizes."""

import pytest

from vdet.errors import ConfigError
from vdet.lanes.camera import Camera


def test_its_matrix_is_that_of_a_pinhole(wide_camera: Camera) -> None:
    assert wide_camera.matrix.tolist() == [[560, 0, 322], [0, 558, 236], [0, 0, 1]]


def test_at_its_own_size_it_stays_as_it_is(wide_camera: Camera) -> None:
    assert wide_camera.scaled_to(640, 480) == wide_camera


def test_at_twice_the_size_all_lengths_are_twice_as_long(wide_camera: Camera) -> None:
    scaled = wide_camera.scaled_to(1280, 960)
    assert scaled.focal == (1120, 1116)
    assert scaled.center == (644.5, 472.5)  # the frame's corner, not its first pixel, stays
    assert scaled.distortion == wide_camera.distortion
    assert (scaled.width, scaled.height, scaled.rms) == (1280, 960, 1.0)


def test_a_size_of_the_same_shape_but_for_rounding_will_do() -> None:
    camera = Camera(1280, 720, (1150, 1150), (640, 360), (0, 0, 0, 0, 0), 1)
    assert camera.scaled_to(854, 480).width == 854


@pytest.mark.parametrize("size", [(640, 360), (480, 640), (660, 480)])
def test_another_shape_is_refused(wide_camera: Camera, size: tuple[int, int]) -> None:
    with pytest.raises(ConfigError, match=r"calibrated for 640×480 .* another shape"):
        wide_camera.scaled_to(*size)


def test_a_usual_camera_has_no_flaw(wide_camera: Camera) -> None:
    assert wide_camera.flaw is None
