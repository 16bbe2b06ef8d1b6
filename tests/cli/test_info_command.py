"""`vdet info`: what a file is, and whether vdet works on this machine."""

import json
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest

from clips import write_clip
from conftest import Run
from detect.onnx.graphs import RedBox, ultralytics, write_network
from vdet.errors import ModelError
from writing import write_image

MODELS = Path(__file__).parents[2] / "src" / "vdet" / "models"


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("svm.npz", ("kind: linear model of vdet", "learnt boxes: yes")),
        ("net.onnx", ("form: vdet", "input for 1280x720: 640x352", "classes: car; truck; bus")),
    ],
)
def test_a_shipped_model_says_what_it_was_trained_on(
    run: Run, name: str, lines: tuple[str, ...]
) -> None:
    result = run("info", MODELS / name, "--json", "-")
    values = json.loads(result.out)
    assert values["file"] == str(MODELS / name)
    assert values["provenance"]["program"].startswith("vdet ")
    assert values["trained_on"]
    for line in lines:
        assert line in result.err


def test_another_network_says_what_it_was_taken_for(run: Run, tmp_path: Path) -> None:
    form = ultralytics((128, 64), RedBox(64, 32, 16, 8), 80)
    path = write_network(tmp_path / "their.onnx", form, (128, 64), (0, 0))
    result = run("info", path, code=0)
    assert "form: Ultralytics v8 or later" in result.out
    assert "classes: person; bicycle; car; motorcycle; bus; truck\n" in result.out
    assert "other classes: airplane; train; boat; " in result.out


def test_a_video_is_described(run: Run, tmp_path: Path) -> None:
    path = write_clip(tmp_path / "v_20260501_065959.mov", size=(160, 96), rotation=90)
    result = run("info", path, "--json", tmp_path / "facts.json", code=0)
    for line in ("width: 160", "rate: 25", "frames: 12", "begins: 2026-05-01 06:59:59"):
        assert line in result.out
    values = json.loads((tmp_path / "facts.json").read_text())
    assert (values["width"], values["height"], values["declared_frames"]) == (160, 96, 12)
    assert (values["rate"], values["seconds"]) == (25, 0.48)
    again = run("info", path, "--json", tmp_path / "facts.json")
    assert (again.code, again.err.count("\n")) == (1, 1)
    assert "already exists" in again.err


def test_numbered_images_are_a_video_and_one_picture_is_not(run: Run, tmp_path: Path) -> None:
    for number in range(3):
        write_image(tmp_path / f"img_{number}.png", np.full((96, 160, 3), 90, np.uint8))
    for path, words in (
        (tmp_path, "frames: 3"),
        (tmp_path / "img_%d.png", "frames: 3"),
        (tmp_path / "img_1.png", "kind: image\nwidth: 160\nheight: 96"),
    ):
        result = run("info", path)
        assert (result.code, words in result.out) == (0, True), result.out + result.err


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("notes.txt", "is not a video"),
        ("none.mp4", "not found"),
        ("none.onnx", "none.onnx: cannot be"),
    ],
)
def test_what_is_neither_is_an_error(run: Run, tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / "notes.txt").write_text("hello")
    result = run("info", tmp_path / name)
    assert (result.code, result.out) == (1, "")
    assert words in result.err


def test_without_a_file_the_machine_is_checked(run: Run) -> None:
    result = run("info", "--json", "-", code=0)
    values = json.loads(result.out)
    assert values["works"]
    assert not [text for text in map(str, values.values()) if text.startswith("broken")]
    assert {"vdet", "numpy", "codec h264", "settings default"} <= values.keys()


def test_what_does_not_work_is_named_with_what_to_do(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> NoReturn:
        raise ModelError("net.onnx: is damaged")

    def version(name: str) -> str:
        if name in ("dask", "numpy"):
            raise PackageNotFoundError
        return "1.0"

    monkeypatch.setattr("importlib.metadata.version", version)
    monkeypatch.setattr("av.Codec", fail)
    monkeypatch.setattr("vdet.detect.factory.load_detector", fail)
    result = run("info")
    assert result.code == 1
    assert "dask (extra dask): not installed; pip install dask\n" in result.out
    assert "numpy: broken; pip install numpy\n" in result.out
    assert "codec h264: broken; " in result.out
    assert "settings default: broken; net.onnx: is damaged; install vdet again\n" in result.out
    assert result.out.endswith("works: no\n")


def test_another_opencv_over_ours_is_named_with_the_cure(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> NoReturn:
        raise AttributeError("module 'cv2' has no attribute 'HOGDescriptor'")

    monkeypatch.delattr("cv2.HOGDescriptor")
    monkeypatch.setattr("cv2.__version__", "5.0.0")
    cure = (
        "opencv-python has replaced opencv-python-headless; run "
        '"pip uninstall -y opencv-python opencv-python-headless" and then '
        "\"pip install 'opencv-python-headless<5'\"\n"
    )
    assert f"cv2: broken; {cure}" in run("info").out
    monkeypatch.setattr("vdet.config.rendering.render_settings", fail)
    assert run("config").err == f"vdet: {cure}"
