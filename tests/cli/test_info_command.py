"""`vdet info`: what a model file is."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from conftest import Run
from detect.onnx.graphs import RedBox, ultralytics, write_network

MODELS = Path(__file__).parents[2] / "src" / "vdet" / "models"


LINEAR = ("a linear model of vdet", "sides of boxes: learnt", "data_sha256: ")
NETWORK = (
    "a network of the form vdet",
    "input: 512×288 for a frame of 1280×720, BGR up to 255",
    "vehicles: car, truck, bus",
    '"steps": ',
)


@pytest.mark.parametrize(("name", "told"), [("default.npz", LINEAR), ("net.onnx", NETWORK)])
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
