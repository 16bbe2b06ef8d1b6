"""`vdet paths` and `vdet suggest-lines`."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from conftest import Run
from running import write_drive
from vdet.config.loading import load_settings

LINES = """
camera: {size: [320, 240]}
traffic: {lines: [{name: gate, start: [100, 20], end: [100, 220]}]}
"""


@pytest.fixture
def clip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lines.yaml").write_text(LINES)
    return write_drive(tmp_path / "in.mp4", 50)


@pytest.fixture
def tracks(tmp_path: Path) -> Path:
    """Three cars that go to the right, 4 pixels a frame."""
    rows = [
        f"{n},{n / 25:.6f},{number},{4 * n},{60 + 20 * number},40,30"
        for n in range(60)
        for number in (1, 2, 3)
    ]
    path = tmp_path / "tracks.csv"
    path.write_text("\n".join(["frame,time,id,x,y,width,height", *rows]) + "\n")
    return path


def pixels(path: str) -> np.ndarray:
    image = cv2.imread(path)
    assert image is not None
    return image.astype(int)


def test_the_paths_are_those_of_the_run(run: Run, clip: Path, red: tuple[str, ...]) -> None:
    assert run("paths", clip, "--no-paths", "-o", "empty.png").code == 0
    result = run("paths", clip, "-o", "paths.png", *red)
    assert (result.code, result.out) == (0, "paths.png: 320×240, 1 vehicle\n"), result.err
    assert (pixels("paths.png") != pixels("empty.png")).any()


def test_saved_tracks_need_only_a_picture(run: Run, clip: Path, tracks: Path) -> None:
    run("paths", clip, "--no-paths", "-o", "frame.png")
    result = run("paths", "frame.png", "--tracks-from", tracks, "-o", "paths.png")
    assert (result.code, result.out) == (0, "paths.png: 320×240, 3 vehicles\n"), result.err


@pytest.mark.parametrize(
    ("part", "vehicles"),
    [(("--start", "0.1", "--end", "0.9"), "1 vehicle"), (("--end", "1.9"), "2 vehicles")],
)
def test_saved_tracks_are_taken_from_the_part_that_is_named(
    run: Run, clip: Path, part: tuple[str, ...], vehicles: str
) -> None:
    """Frames of .txt have the times of the clip, 25 a second; the second car comes after 1.2 s."""
    rows = [f"{n},{1 + (n > 30)},{4 * n},80,40,30,1,-1,-1,-1" for n in range(1, 50)]
    Path("t.txt").write_text("\n".join(rows) + "\n")
    result = run("paths", clip, "--tracks-from", "t.txt", "-o", "paths.png", *part)
    assert (result.code, result.out) == (0, f"paths.png: 320×240, {vehicles}\n"), result.err


def test_lines_are_shown_without_a_run(run: Run, clip: Path) -> None:
    run("paths", clip, "--no-paths", "-o", "empty.png")
    result = run("paths", clip, "--no-paths", "-c", "lines.yaml", "-o", "preview.png")
    assert (result.code, result.out) == (0, "preview.png: 320×240\n"), result.err
    changed = (pixels("preview.png") != pixels("empty.png")).any(axis=2)
    assert changed[60:200, 100].all()


@pytest.mark.parametrize("size", ["[320, 100]", "null"])
def test_lines_for_another_frame_are_refused(run: Run, clip: Path, size: str) -> None:
    Path("other.yaml").write_text(LINES.replace("[320, 240]", size))
    result = run("paths", clip, "--no-paths", "-c", "other.yaml", "-o", "preview.png")
    assert result.code == 1
    assert not Path("preview.png").exists()


def test_proposed_lines_work_at_once(run: Run, clip: Path, tracks: Path) -> None:
    result = run("suggest-lines", clip, "--tracks-from", tracks, "-o", "new.yaml")
    assert (result.code, result.out) == (0, "new.yaml: 2 lines, 3 vehicles\n"), result.err
    assert "# 3 vehicles, going right in the picture" in Path("new.yaml").read_text()
    traffic = load_settings([Path("new.yaml")]).traffic
    assert [line.name for line in traffic.lines] == ["in 1", "out 1"]
    counted = run("count", tracks, "-c", "new.yaml")
    rows = [line.split()[1:5] for line in counted.out.splitlines()]
    assert ["in", "1", "along", "3"] in rows
    assert ["out", "1", "along", "3"] in rows


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["paths", "in.mp4", "-o", "in.mp4"], "pictures are written as .jpg"),
        (["paths", "in.mp4", "--start", "9:00", "-o", "a.jpg"], "has no frame at 540.00 s"),
        (["paths", "none.mp4", "-o", "a.jpg"], "none.mp4"),
        (["suggest-lines", "in.mp4", "-o", "a.csv"], "lines are written as .yaml"),
        (
            ["suggest-lines", "in.mp4", "--tracks-from", "empty.csv", "-o", "a.yaml"],
            "no vehicle moves",
        ),
    ],
)
def test_wrong_use_is_refused(run: Run, clip: Path, arguments: list[str], message: str) -> None:
    clip.with_name("empty.csv").write_text("frame,time,id,x,y,width,height\n")
    result = run(*arguments)
    assert result.code == 1
    assert message in result.err
