"""No output takes the place of a file that the run reads, in whatever way that was found."""

from pathlib import Path

import numpy as np
import pytest

from conftest import Run
from labels.writers import Boxed, Labelled, show, write_coco, write_yolo
from red_cars import CAR, HEIGHT, WIDTH, road
from running import write_drive


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Sets of labelled pictures, numbered ones, a clip and a mask, in the current folder."""
    monkeypatch.chdir(tmp_path)
    boxes = (Boxed("car", (CAR.x1, CAR.y1, CAR.width, CAR.height)),)
    pictures = {name: Labelled(WIDTH, HEIGHT, boxes) for name in "ab"}
    write_coco(tmp_path / "set", pictures)
    write_yolo(tmp_path / "yset", pictures)
    (tmp_path / "frames").mkdir()
    for number in range(1, 4):
        show(tmp_path / "frames" / f"img_{number:04d}.png", road(CAR))
    show(tmp_path / "mask.png", np.full_like(road(CAR), 255))
    (tmp_path / "settings.yaml").write_text("regions: [{name: road, mask: mask.png}]\n")
    (tmp_path / "out").mkdir()
    (tmp_path / "again").symlink_to("out")  # as a second mount of the folder
    line = "{name: a, start: [0, 0.5], end: [1, 0.5]}"
    (tmp_path / "out" / "in.json").write_text(f"traffic: {{lines: [{line}]}}")
    (tmp_path / "link.png").symlink_to("mask.png")
    write_drive(tmp_path / "in.mp4", 3)
    return tmp_path


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "arguments",
    [
        "eval images set --json set/annotations.json",
        "eval images set --json set/a.png",
        "eval images set/annotations.json --json set/b.png",
        "eval images yset --json yset/data.yaml",
        "eval images yset --json yset/labels/a.txt",
        "detect-image frames --json frames/img_0002.png",
        "detect-image frames -o frames",
        "detect-image set/a.png -c settings.yaml --json link.png",
        "detect-video in.mp4 in.mp4",
        "detect-video frames --no-video -c settings.yaml --sink image=mask.png",
        "detect-video in.mp4 --no-video -c out/in.json --counts out/in.json",
        "detect-video in.mp4 --no-video -c out/in.json --counts again/in.json",
        "detect-video in.mp4 --no-video -c out/in.json --counts .json -d out",
    ],
)
def test_inputs_are_kept_also_with_overwrite(run: Run, folder: Path, arguments: str) -> None:
    before = contents(folder)
    result = run(*arguments.split(), "--overwrite")
    assert contents(folder) == before, "files were changed, or others were left"
    refused = result.err.endswith("is an input of this run; use another output\n")
    assert (result.code, refused) == (1, True), result.err
