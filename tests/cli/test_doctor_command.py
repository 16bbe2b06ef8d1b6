"""`vdet doctor`: whether the program can work here."""

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


def findings(run: Run) -> dict[str, tuple[str, str]]:
    values = json.loads(run("doctor", "--json", "-").out)
    return {each["name"]: (each["status"], each["text"]) for each in values["findings"]}


def test_here_it_can_work(run: Run) -> None:
    result = run("doctor")
    assert result.code == 0
    *lines, verdict = result.out.splitlines()
    assert verdict == "vdet can work here"
    assert all(line.startswith(("ok ", "absent ")) for line in lines)
    for name in ("vdet", "Python", "OpenCV", "PyAV", "numpy", "cores", "encoder libx264"):
        assert sum(f" {name}: " in line for line in lines) == 1
    for config in ("default", "svm", "seed"):
        assert any(f"config {config}: " in line for line in lines)


def test_an_extra_that_is_not_there_is_named_with_the_command_that_installs_it(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = doctor._version
    monkeypatch.setattr(doctor, "_version", lambda name: None if name == "dask" else known(name))
    assert findings(run)["extra dask"] == ("absent", "needs dask; pip install dask")
    assert run("doctor").code == 0


def test_an_old_or_new_opencv_without_hog_is_told(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(cv2, "HOGDescriptor")
    result = run("doctor")
    assert result.code == 1
    assert "broken  OpenCV: " in result.out
    assert result.out.endswith("vdet cannot work here: see what is broken\n")


def test_an_encoder_that_cannot_be_opened_is_told(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail() -> NoReturn:
        raise ValueError("no libx264")

    monkeypatch.setattr(doctor, "_encode", fail)
    status, text = findings(run)["encoder libx264"]
    assert (status, "no libx264" in text) == ("broken", True)
    assert run("doctor").code == 1


def test_a_model_that_does_not_load_is_told(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> NoReturn:
        raise ModelError("default.npz: is damaged")

    monkeypatch.setattr(doctor, "load_detector", fail)
    status, text = findings(run)["config default"]
    assert (status, text) == ("broken", "default.npz: is damaged; install vdet again")


def test_the_data_set_is_looked_for(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VDET_DATA", str(tmp_path))
    status, text = findings(run)["VDET_DATA"]
    assert (status, "without vehicles.zip" in text) == ("absent", True)
    for name in doctor.DATA:
        (tmp_path / name).touch()
    assert findings(run)["VDET_DATA"] == ("ok", str(tmp_path))


def test_packages_and_extras_are_those_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = {
        extra: tuple(requirement.partition(">")[0] for requirement in requirements)
        for extra, requirements in project["optional-dependencies"].items()
        if extra != "dev"
    }
    assert extras == EXTRAS
    needed = {requirement.partition(">")[0] for requirement in project["dependencies"]}
    assert needed == {*NEEDED, "av", "numpy", "opencv-python-headless"}
