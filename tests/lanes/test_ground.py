"""The road plane: from points in pixels and metres, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from lanes.poles import CORNERS, HEIGHT, WIDTH, ground_text, seen
from vdet.boxes import Float64Array
from vdet.config.loading import load_settings
from vdet.config.scene import CameraSettings, GroundPoint, LensSettings
from vdet.errors import ConfigError
from vdet.lanes.camera import Ground, Undistorter, fit_ground, ground_of

PLAIN = Undistorter(None, WIDTH, HEIGHT)
EDGE = 0.5
"""Whole numbers are middles of pixels in a file, and edges of pixels in boxes."""
CAMERA = LensSettings(
    size=(WIDTH, HEIGHT),
    matrix=((1000, 0, 640), (0, 1000, 360), (0, 0, 1)),
    distortion=(-0.25, 0.05, 0, 0, 0),
)


def fitted(metres: Float64Array = CORNERS, pixels: Float64Array | None = None) -> Ground:
    return fit_ground(seen(metres) if pixels is None else pixels, metres, PLAIN)


def test_metres_may_have_any_origin() -> None:
    utm = np.array([391_000.0, 5_820_000.0])
    steps = fitted(CORNERS + utm, seen(CORNERS)).metres(seen(CORNERS) + EDGE)
    assert steps - steps[0] == pytest.approx(CORNERS - CORNERS[0], abs=1e-3)
    assert GroundPoint(pixel=(0, 0), metres=(391_000, 5_820_000)).metres == (391_000, 5_820_000)


def test_a_place_above_the_horizon_is_not_known() -> None:
    assert np.isnan(fitted().metres(np.array([(640.0, 20.0)]))).all()


@pytest.mark.parametrize(("beyond", "known"), [(30.0, True), (45.0, False)])
def test_a_place_is_known_up_to_one_length_beyond_the_area(beyond: float, known: bool) -> None:
    ground = fitted()
    assert ground.length == pytest.approx(np.hypot(12, 36), abs=0.01)
    place = ground.metres(seen(np.array([(0.0, 50.0 + beyond)])) + EDGE)
    assert np.isfinite(place).all() == known


@pytest.mark.parametrize(
    ("metres", "pixels", "message"),
    [
        (CORNERS[:3], seen(CORNERS[:3]), "camera.ground: has 3 points; must be at least four"),
        (CORNERS * (0, 1), seen(CORNERS * (0, 1)), "are on a line (pixel)"),
        (np.array([(0, 14), (0, 20), (0, 30), (5, 30)]), None, "or all but one, are on a line"),
        (CORNERS * (0, 1), seen(CORNERS), "are on a line (metres)"),
        (CORNERS, seen(CORNERS)[[0, 2, 1, 3]], "the horizon is between the points"),
        (CORNERS / 111_000, seen(CORNERS), "metres are expected, not degrees"),
    ],
)
def test_points_that_fix_no_plane_are_refused_in_words(
    metres: Float64Array, pixels: Float64Array | None, message: str
) -> None:
    with pytest.raises(ConfigError) as error:
        fitted(np.asarray(metres, np.float64), pixels)
    assert message in str(error.value)


def test_a_point_that_does_not_fit_the_others_is_named() -> None:
    metres = np.vstack([CORNERS, [(0.0, 30.0), (3.0, 20.0)]])
    wrong = metres.copy()
    wrong[4] = 5.0, 30.0
    with pytest.raises(
        ConfigError, match=r"camera\.ground\[4\]: is .*m from where the other points place it"
    ):
        fitted(wrong, seen(metres))


def camera_of(folder: Path, text: str) -> CameraSettings:
    path = folder / "ground.yaml"
    path.write_text(text)
    return load_settings([path]).camera


def test_a_file_is_for_frames_of_any_size_and_the_same_shape(tmp_path: Path) -> None:
    camera = camera_of(tmp_path, ground_text(seen(CORNERS), CORNERS))
    place = np.array([(2.0, 30.0)])
    half = ground_of(camera, WIDTH // 2, HEIGHT // 2)
    assert half is not None
    assert half.metres(seen(place) / 2 + EDGE) == pytest.approx(place, abs=0.01)


def test_a_lens_that_distorts_is_corrected(tmp_path: Path) -> None:
    lens = Undistorter(CAMERA, WIDTH, HEIGHT)
    camera = camera_of(tmp_path, ground_text(lens.distorted(seen(CORNERS)), CORNERS))
    place = np.array([(2.0, 30.0)])
    ground = ground_of(camera.model_copy(update={"lens": CAMERA}), WIDTH, HEIGHT)
    assert ground is not None
    assert ground.metres(lens.distorted(seen(place)) + EDGE) == pytest.approx(place, abs=0.02)
