"""`vdet demo`: both detectors on a drawn road, and what they find against the truth."""

from dataclasses import replace
from pathlib import Path

import pytest

from conftest import Run
from running import frames_of
from vdet.synthetic import Scene, demo_scene

FRAMES = 60
NAMES = {
    *("road.mp4", "truth.txt", "found.mp4", "found.csv"),
    *("pole.mp4", "pole.txt", "gate.yaml", "counted.mp4", "pole.csv", "flows.csv", "page"),
    *("training", "patches.zip", "model.npz", "model.csv", "stages"),
}


def short_clip(seed: int) -> Scene:
    """Return the demo's road while the camera overtakes a vehicle."""
    return replace(demo_scene(seed), frames=FRAMES)


def test_draws_finds_counts_trains_and_compares(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vdet.demo.ROADS", 1)
    monkeypatch.setattr("vdet.demo.demo_scene", short_clip)
    folder = tmp_path / "new" / "demo"
    result = run("demo", folder, code=0)
    assert {path.name for path in folder.iterdir()} == NAMES
    assert len(list((folder / "training").iterdir())) == 2, "a road and its truth"
    assert frames_of(folder / "found.mp4") == FRAMES
    assert [step in result.err for step in ("1/4", "2/4", "3/4", "4/4")] == [True] * 4
    _, network, linear = result.out.splitlines()[:3]
    assert network.startswith("network")
    assert float(network.split()[3]) > 0.8, "F1 of the network"
    assert ["north", "south", "4", "4"] in [line.split() for line in result.out.splitlines()]
    assert linear.startswith("linear model model.npz")
    assert f"All files are in {folder}: found.mp4 and page/page.html" in result.out
    assert (folder / "page" / "page.html").exists()

    again = run("demo", folder)
    assert again.code == 1
    assert "is not empty; choose another folder, or use --overwrite" in again.err
    assert again.err.count("\n") == 1


def test_a_file_for_a_folder(run: Run, tmp_path: Path) -> None:
    (tmp_path / "demo").write_text("precious")
    result = run("demo", tmp_path / "demo")
    assert result.code == 1
    assert result.err.count("\n") == 1
    assert "cannot be created" in result.err
    assert (tmp_path / "demo").read_text() == "precious"
