"""`vdet info`: what a video, a picture or a model file is."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from clips import write_clip
from conftest import Run
from detect.onnx.graphs import RedBox, ultralytics, write_network
from vdet.media.images import write_image

MODELS = Path(__file__).parents[2] / "src" / "vdet" / "models"


LINEAR = ("a linear model of vdet", "sides of boxes: learnt", "data_sha256: ")
NETWORK = (
    "a network of the form vdet",
    "input: 640×352 for a frame of 1280×720, BGR up to 255",
    "vehicles: car, truck, bus",
    '"steps": ',
)


@pytest.mark.parametrize(("name", "told"), [("svm.npz", LINEAR), ("net.onnx", NETWORK)])
def test_a_shipped_model_says_what_it_was_trained_on(
    run: Run, name: str, told: Sequence[str]
) -> None:
    result = run("info", MODELS / name)
    assert result.code == 0
    for words in told:
        assert words in result.out


def test_another_network_says_why_it_was_taken_for_what(run: Run, tmp_path: Path) -> None:
    form = ultralytics((128, 64), RedBox(64, 32, 16, 8), 80)
    path = write_network(tmp_path / "their.onnx", form, (128, 64), (0, 0))
    result = run("info", path)
    assert result.code == 0
    assert "a network of the form Ultralytics v8 or later" in result.out
    assert "its output is (1, 84, 168): columns of box and class scores" in result.out
    assert "vehicles: car, motorcycle, bus, truck" in result.out
    assert "other classes: person, bicycle, " in result.out


def test_a_file_that_is_no_model_is_an_error(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "none.onnx"
    path.write_bytes(b"nothing")
    result = run("info", path)
    assert result.code == 1
    assert "none.onnx: cannot be loaded by onnxruntime" in result.err


def test_a_model_is_described_as_json_too(run: Run) -> None:
    for name, kind in (("svm.npz", "linear model"), ("net.onnx", "network")):
        result = run("info", MODELS / name, "--json", "-")
        values = json.loads(result.out)
        assert (values["kind"], values["file"]) == (kind, str(MODELS / name))
        assert values["provenance"]
        assert "a " in result.err


def test_a_video_is_described(run: Run, tmp_path: Path) -> None:
    path = write_clip(tmp_path / "in.mov", size=(160, 96), rotation=90, sounds=["aac", "pcm_mulaw"])
    result = run("info", path)
    assert result.code == 0
    for line in (
        "size: 160×96, upright; stored pictures are turned by 90° counter-clockwise",
        "frames: about 12",
        "rate: 25 frames/s on average",
        "length: 0:00:00.480",
        "codec: h264, yuv420p",
        "sound 1: aac, 48000 Hz",
        "lost in .mp4: sound 2",
        "horizon: not found, so it is taken at 0.58 of the height",
    ):
        assert line in result.out


def test_a_video_is_described_as_json(run: Run, tmp_path: Path, clip_path: Path) -> None:
    result = run("info", clip_path, "--json", tmp_path / "facts.json")
    assert result.out.startswith(f"{clip_path}: a video")
    values = json.loads((tmp_path / "facts.json").read_text())
    assert (values["width"], values["height"], values["frames"]) == (320, 180, 30)
    assert (values["rate"], values["rotation"], values["lost"]) == (25.0, 0, [])
    assert 0.3 <= values["horizon"] <= 0.74
    again = run("info", clip_path, "--json", tmp_path / "facts.json")
    assert (again.code, again.err.count("\n")) == (1, 1)
    assert "is there already" in again.err


def test_numbered_pictures_are_a_video_and_one_picture_is_not(run: Run, tmp_path: Path) -> None:
    for number in range(3):
        write_image(tmp_path / f"img_{number}.png", np.full((96, 160, 3), 90, np.uint8))
    for path, words in (
        (tmp_path, "frames: about 3"),
        (tmp_path / "img_%d.png", "frames: about 3"),
        (tmp_path / "img_1.png", "a picture\nsize: 160×96"),
    ):
        result = run("info", path)
        assert (result.code, words in result.out) == (0, True), result.out + result.err


def test_what_is_no_video_is_an_error(run: Run, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("hello")
    for name, words in (("notes.txt", "is not a video"), ("none.mp4", "there is no such file")):
        result = run("info", tmp_path / name)
        assert (result.code, result.out) == (1, "")
        assert words in result.err
