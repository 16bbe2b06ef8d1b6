"""`vdet info`: what a model is, and whether vdet works on this machine."""

import json
from pathlib import Path
from typing import NoReturn

import pytest

from conftest import Run
from detect.onnx.graphs import RedBox, ultralytics, write_network
from vdet.errors import ModelError

MODELS = Path(__file__).parents[2] / "src" / "vdet" / "models"


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("svm.npz", ("kind: linear model of vdet", "learnt boxes: yes")),
        ("net.onnx", ("form: vdet", "input for 1280x720: 640x352", "classes: car; truck; bus")),
    ],
)
def test_a_shipped_model_is_described(run: Run, name: str, lines: tuple[str, ...]) -> None:
    result = run("info", MODELS / name, "--json", "-")
    values = json.loads(result.out)
    assert values["file"] == str(MODELS / name)
    assert values["provenance"]["program"].startswith("vdet ")
    for line in lines:
        assert line in result.err


def test_another_network_says_what_it_was_taken_for(run: Run, tmp_path: Path) -> None:
    form = ultralytics((128, 64), RedBox(64, 32, 16, 8), 80)
    path = write_network(tmp_path / "their.onnx", form, (128, 64), (0, 0))
    result = run("info", path, code=0)
    assert "form: Ultralytics v8 or later" in result.out
    assert "classes: person; bicycle; car; motorcycle; bus; truck\n" in result.out
    assert "other classes: airplane; train; boat; " in result.out


def test_without_a_file_the_shipped_models_are_loaded(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = json.loads(run("info", "--json", "-", code=0).out)
    assert values["vdet"].endswith(" cores")
    assert {"default", "svm", "seed"} <= set(values["settings"])

    def fail(*_: object) -> NoReturn:
        raise ModelError("net.onnx: is damaged")

    monkeypatch.setattr("vdet.detect.detectors.load_detector", fail)
    result = run("info")
    assert (result.code, result.err) == (1, "vdet: net.onnx: is damaged\n")
