"""The camera file: what is written can be read; mistakes are named."""

from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vdet.errors import ConfigError, OutputError
from vdet.lanes.camera import CalibratedCamera
from vdet.lanes.camera_file import load_camera, save_camera

GOOD = {
    "width": 640,
    "height": 480,
    "matrix": [[560.0, 0, 322.0], [0, 558.0, 236.0], [0, 0, 1]],
    "distortion": [-0.25, 0.06, 0.0, 0.0, 0.0],
    "rms": 0.5,
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "camera.yaml"


def refusal(path: Path, **changes: object) -> str:
    path.write_text(yaml.safe_dump(GOOD | changes, sort_keys=False), encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_camera(path)
    return str(error.value).replace(str(path), "camera.yaml")


small = st.floats(-10, 10)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
@given(
    focal=st.tuples(st.floats(64, 64000), st.floats(64, 64000)),
    center=st.tuples(st.floats(0, 639), st.floats(0, 479)),
    distortion=st.tuples(small, small, small, small, small),
    rms=st.floats(0, 100),
)
def test_every_camera_is_read_with_all_its_digits(
    path: Path,
    focal: tuple[float, float],
    center: tuple[float, float],
    distortion: tuple[float, float, float, float, float],
    rms: float,
) -> None:
    camera = CalibratedCamera(640, 480, focal, center, distortion, rms)
    save_camera(camera, path, overwrite=True)
    assert load_camera(path) == camera


def test_the_file_explains_its_values(path: Path, wide_camera: CalibratedCamera) -> None:
    save_camera(wide_camera, path, overwrite=True)
    text = path.read_text(encoding="utf-8")
    for words in ("# frame size, pixels", "width: 640", "[[fx, 0, cx]", "k1, k2, p1, p2, k3"):
        assert words in text


@pytest.mark.parametrize("focal", [0, -560.0, 1.0, 1e6])
def test_an_impossible_focal_length_is_refused(path: Path, focal: float) -> None:
    message = refusal(path, matrix=[[focal, 0, 322.0], [0, 558.0, 236.0], [0, 0, 1]])
    assert message.startswith("camera.yaml:3:1: matrix: focal lengths should be 64 to 64000 px")


def test_a_principal_point_outside_the_frame_is_refused(path: Path) -> None:
    message = refusal(path, matrix=[[560.0, 0, 322.0], [0, 558.0, 500.0], [0, 0, 1]])
    assert "the principal point should lie in the frame (is 322, 500)" in message


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("width", "wide", "camera.yaml:1:1: width: should be a valid integer"),
        ("height", 0, "camera.yaml:2:1: height: should be greater than or equal to 16"),
        ("matrix", [[1, 2], [3, 4]], "camera.yaml:4:3: matrix[0][2]: is missing"),
        ("matrix", 7, "camera.yaml:3:1: matrix: should be a valid tuple"),
        ("distortion", [0.1, 0.2], "distortion[2]: is missing"),
        ("distortion", [0, 0, 0, 0, float("nan")], "distortion[4]: should be a finite number"),
        ("rms", float("inf"), "rms: should be a finite number"),
        ("rms", -1, "rms: should be greater than or equal to 0"),
        ("colour", "red", "colour: is not a key of camera files; known: width,"),
    ],
)
def test_each_mistake_is_named_with_its_place(
    path: Path, key: str, value: object, message: str
) -> None:
    assert message in refusal(path, **{key: value})


def test_a_missing_key_is_named(path: Path) -> None:
    path.write_text("width: 640\nheight: 480\n")
    with pytest.raises(
        ConfigError, match=r"camera\.yaml:1:1: matrix: is missing; `vdet calibrate`"
    ):
        load_camera(path)


def test_writing_into_a_missing_folder_is_an_error(
    tmp_path: Path, wide_camera: CalibratedCamera
) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        save_camera(wide_camera, tmp_path / "none" / "camera.yaml")
