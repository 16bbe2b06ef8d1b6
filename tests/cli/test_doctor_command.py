"""`vdet doctor`: whether everything that the program needs is there and works."""

import json
import tomllib
from pathlib import Path
from typing import Any, NoReturn

import cv2
import pytest

from conftest import Run
from vdet.cli import doctor
from vdet.cli.doctor import EXTRAS, NEEDED
from vdet.errors import ModelError

ROOT = Path(__file__).parents[2]


def test_here_it_works(run: Run) -> None:
    result = run("doctor", "--json", "-")
    assert result.code == 0
    *lines, verdict = result.err.splitlines()
    assert verdict == "vdet works here"
    assert all(line.startswith(("ok ", "absent ")) for line in lines)
    values = json.loads(result.out)
    assert values["works"]
    names = {each["name"] for each in values["findings"]}
    assert {"vdet", "packages", "cores", "encoder", "decoders", "settings default"} <= names


def test_what_does_not_work_is_named_with_what_to_do(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> NoReturn:
        raise ModelError("net.onnx: is damaged")

    known = doctor._version
    monkeypatch.setattr(doctor, "_version", lambda name: None if name == "dask" else known(name))
    monkeypatch.setattr(doctor, "_check_encoder", fail)
    monkeypatch.setattr("vdet.detect.factory.load_detector", fail)
    monkeypatch.delattr(cv2, "HOGDescriptor")
    result = run("doctor")
    assert result.code == 1
    assert "absent  extra dask: pip install dask\n" in result.out
    assert "broken  settings default: net.onnx: is damaged; install vdet again\n" in result.out
    for name in ("packages", "encoder"):
        assert f"broken  {name}: " in result.out
    assert result.out.endswith("vdet does not work here: see what is broken\n")


def test_packages_and_extras_are_those_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = {
        extra: tuple(requirement.partition(">")[0] for requirement in requirements)
        for extra, requirements in project["optional-dependencies"].items()
        if extra != "dev"
    }
    assert extras == EXTRAS
    assert {requirement.partition(">")[0] for requirement in project["dependencies"]} == {*NEEDED}
