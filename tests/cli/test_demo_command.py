"""`vdet demo`."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from conftest import Run
from quick import only_windows
from vdet import demo
from vdet.synthetic import demo_scene
from vdet.synthetic.scene import Scene

FEW_WINDOWS = only_windows("size: 128, overlap: 0.7, top: 370, bottom: 600")
FRAMES = 12


def _short_clip(seed: int) -> Scene:
    return replace(demo_scene(seed, width=320, height=180), frames=FRAMES)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo, "PATCHES", 60)
    monkeypatch.setattr(demo, "demo_scene", _short_clip)


@pytest.mark.usefixtures("small")
def test_says_what_it_measured_and_where_to_look(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "demo"
    result = run("demo", folder, *FEW_WINDOWS)
    assert result.code == 0, result.err
    for split in ("random", "tail"):
        assert re.search(rf"patches, {split} split: test accuracy [01]\.\d{{3}}", result.out)
    assert f"video: {FRAMES} frames in " in result.out
    for words in ("precision", "recall", "F1", "IoU 0.5", "IDF1", "id switches"):
        assert words in result.out
    for name in ("found.mp4", "stages", "found.jsonl", "truth.txt", "model.json"):
        assert str(folder / name) in result.out
        assert (folder / name).exists()
    for step in ("1/4", "2/4", "3/4", "4/4"):
        assert step in result.err

    again = run("demo", folder, *FEW_WINDOWS)
    assert again.code == 1
    assert "is there already; give --overwrite" in again.err
    assert again.err.count("\n") == 1


def test_a_file_for_a_folder(run: Run, tmp_path: Path) -> None:
    (tmp_path / "demo").write_text("precious")
    result = run("demo", tmp_path / "demo")
    assert result.code == 1
    assert result.err.count("\n") == 1
    assert "internal error" not in result.err
    assert (tmp_path / "demo").read_text() == "precious"


def test_a_wrong_setting_is_refused_before_anything_is_drawn(run: Run, tmp_path: Path) -> None:
    result = run("demo", tmp_path / "demo", "--set", "detector.heat.treshold=2")
    assert result.code == 1
    assert "detector.heat.treshold" in result.err
    assert list(tmp_path.iterdir()) == []


def test_a_seed_is_a_whole_number(run: Run, tmp_path: Path) -> None:
    result = run("demo", tmp_path / "demo", "--seed", "-1")
    assert result.code == 2
    assert "is not in the range" in result.err
