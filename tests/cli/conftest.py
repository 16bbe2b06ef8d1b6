"""What tests of several commands need."""

from dataclasses import replace
from pathlib import Path

import pytest

from red_cars import SETTINGS, red_finder
from vdet.config.loading import render_settings
from vdet.detect.svm.model import save_model
from vdet.synthetic import Scene, write_truth


@pytest.fixture
def truth_path(scene: Scene, tmp_path: Path) -> Path:
    """The true boxes of the first nine frames of `clip_path`."""
    path = tmp_path / "gt.txt"
    write_truth(path, replace(scene, frames=9))
    return path


@pytest.fixture(scope="module")
def red(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, ...]:
    """Options with which red cars are found, by the names of files."""
    folder = tmp_path_factory.mktemp("red")
    save_model(red_finder(), folder / "red.npz")
    (folder / "red.yaml").write_text(render_settings(SETTINGS), encoding="utf-8")
    return ("--model", str(folder / "red.npz"), "-c", str(folder / "red.yaml"))
