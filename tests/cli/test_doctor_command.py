"""`vdet doctor`: whether everything that the program needs is there and works."""

import json
from importlib.metadata import PackageNotFoundError
from typing import Any, NoReturn

import pytest

from conftest import Run
from vdet.errors import ModelError


def test_here_it_works(run: Run) -> None:
    result = run("doctor", "--json", "-")
    assert result.code == 0
    *lines, verdict = result.err.splitlines()
    assert verdict == "vdet works here"
    assert all(line.startswith(("ok ", "absent ")) for line in lines)
    values = json.loads(result.out)
    assert values["works"]
    names = {value["name"] for value in values["findings"]}
    assert {"vdet", "numpy", "codec h264", "settings default"} <= names


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
    result = run("doctor")
    assert result.code == 1
    assert "absent  dask (extra dask): pip install dask\n" in result.out
    assert "broken  numpy: pip install numpy\n" in result.out
    assert "broken  codec h264: " in result.out
    assert "broken  settings default: net.onnx: is damaged; install vdet again\n" in result.out
    assert result.out.endswith("vdet does not work here: see what is broken\n")


def test_another_opencv_over_ours_is_named_with_the_cure(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> NoReturn:
        raise AttributeError("module 'cv2' has no attribute 'HOGDescriptor'")

    monkeypatch.delattr("cv2.HOGDescriptor")
    monkeypatch.setattr("cv2.__version__", "5.0.0")
    cure = (
        "OpenCV is 5.0.0: opencv-python has replaced opencv-python-headless; run "
        '"pip uninstall -y opencv-python opencv-python-headless" and then '
        "\"pip install 'opencv-python-headless<5'\"\n"
    )
    assert f"broken  cv2: {cure}" in run("doctor").out
    monkeypatch.setattr("vdet.config.rendering.render", fail)
    assert run("config").err == f"vdet: {cure}"
