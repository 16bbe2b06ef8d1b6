"""What tests of several commands need."""

from dataclasses import replace
from pathlib import Path

import pytest

from vdet.synthetic.clip import write_truth
from vdet.synthetic.scene import Scene


@pytest.fixture
def truth_path(scene: Scene, tmp_path: Path) -> Path:
    """The true boxes of the first eight frames of `clip_path`."""
    path = tmp_path / "gt.txt"
    write_truth(path, replace(scene, frames=8))
    return path
