"""The package of docs/extending.md: its detector, tracker and sink run through every command."""

import importlib
import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from doc_pages import blocks
from labels.writers import Boxed, Labelled, show, write_coco
from red_cars import CAR, HEIGHT, WIDTH, car_at, drive
from running import frames_of, with_modules, write_drive
from vdet.boxes import Box
from vdet.config.schema import Settings
from vdet.testing import check_detector, check_sink, check_tracker
from writing import write_image

FRAMES = 30
CHOSEN = ("--set", "detector.kind=red", "--set", "tracker.kind=nearest")


@pytest.fixture(scope="session")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page's package, as an installer lays it out: the module and its metadata."""
    folder = tmp_path_factory.mktemp("site")
    *code, tests = blocks("extending.md")
    (folder / "my_vdet.py").write_text("\n\n".join(code), encoding="utf-8")
    (folder / "test_my_vdet.py").write_text(tests, encoding="utf-8")
    (project,) = (tomllib.loads(text)["project"] for text in blocks("extending.md", "toml"))
    info = folder / "my_vdet-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 1.0\n"
    )
    lines = [
        line
        for group, points in project["entry-points"].items()
        for line in (f"[{group}]", *(f"{name} = {place}" for name, place in points.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="session")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A red car that drives along."""
    return write_drive(tmp_path_factory.mktemp("red") / "red.mp4", FRAMES)


def vdet(
    package: Path, *arguments: str | Path, code: int = 0
) -> "subprocess.CompletedProcess[str]":
    """Run vdet in a process of its own that finds the package."""
    command = [sys.executable, "-m", "vdet", *map(str, arguments)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env=with_modules(package)
    )
    assert done.returncode == code, done.stderr
    return done


def test_all_three_run_through_detect_video(package: Path, clip: Path, tmp_path: Path) -> None:
    out, tracks, tally = (tmp_path / name for name in ("out.mp4", "out.jsonl", "tally.txt"))
    vdet(
        package,
        *("detect-video", clip, out, *CHOSEN),
        *("--tracks", tracks, "--sink", f"tally={tally}"),
        *("--stages", tmp_path / "stages", "--at", "0.5"),
    )
    assert frames_of(out) == FRAMES
    assert tally.read_text() == "".join(f"{number} 1\n" for number in range(FRAMES))
    records = [json.loads(line) for line in tracks.read_text().splitlines()]
    for number, record in enumerate(records):
        (track,) = record["tracks"]
        assert (track["id"], track["score"], track["state"]) == (1, 0.9, "detected")
        assert abs(track["x"] - car_at(number).x1) <= 2
    names = sorted(path.name for path in (tmp_path / "stages").iterdir())
    assert names == ["1-red.png", "2-boxes.png", "3-tracks.png"]


def test_the_detector_and_the_sink_run_through_detect_image(package: Path, tmp_path: Path) -> None:
    picture, boxes, tally = (tmp_path / name for name in ("red.png", "boxes.json", "tally.txt"))
    (frame,) = drive(1)
    write_image(picture, frame.image)
    vdet(
        package,
        *("detect-image", picture, "--set", "detector.kind=red"),
        *("--json", boxes, "--sink", f"tally={tally}"),
    )
    (item,) = json.loads(boxes.read_text())
    (box,) = item["boxes"]
    assert Box.sized(*(box[side] for side in ("x", "y", "width", "height"))) == car_at(0)
    assert box["score"] == pytest.approx(0.9)
    assert tally.read_text() == "0 1\n"


def test_detector_and_tracker_run_through_eval_video(
    package: Path, clip: Path, tmp_path: Path
) -> None:
    truth = tmp_path / "gt.txt"
    rows = (
        f"{number},7,{car.x1 + 1},{car.y1 + 1},{car.width},{car.height},1,3,1\n"
        for number, car in enumerate(map(car_at, range(FRAMES)), start=1)
    )
    truth.write_text("".join(rows))
    done = vdet(package, *("eval", "video", clip, "--truth", truth, *CHOSEN), *("--json", "-"))
    total = json.loads(done.stdout)["total"]
    assert (total["f1"], total["ap50"], total["id_switches"]) == (1, pytest.approx(1), 0)


def test_the_format_is_written_counted_and_compared(
    package: Path, clip: Path, tmp_path: Path
) -> None:
    tracks, lines, truth = (tmp_path / name for name in ("a.boxes.txt", "lines.yaml", "gt.csv"))
    wanted = ("--tracks", tracks, "--tracks", truth)
    vdet(package, "detect-video", clip, "--no-video", *wanted, *CHOSEN)
    assert len(tracks.read_text().splitlines()) == FRAMES
    lines.write_text("traffic: {lines: [{name: a, start: [0.5, 0], end: [0.5, 1]}]}")
    size = ("--size", f"{WIDTH}x{HEIGHT}", "--rate", "25")
    vdet(package, "count", tracks, "-c", lines, *size)
    compared = vdet(package, "eval", "tracks", tracks, truth, "--json", "-")
    assert json.loads(compared.stdout)["f1"] == 1


def test_the_step_changes_what_all_outputs_get(package: Path, clip: Path, tmp_path: Path) -> None:
    tally, tracks, cars = (tmp_path / name for name in ("tally.txt", "t.csv", "cars.json"))
    ground = ((0, 0.25, 0, 40), (1, 0.25, 20, 40), (1, 1, 15, 5), (0, 1, 5, 5))
    points = (f"{{pixel: [{x}, {y}], metres: [{e}, {n}]}}" for x, y, e, n in ground)
    speeds = ("--vehicles", cars, "--set", f"camera.ground=[{', '.join(points)}]")
    options = ("--no-video", "--tracks", tracks, "--sink", f"tally={tally}", *speeds, *CHOSEN)
    narrow = ("--set", "steps=[wide]")
    vdet(package, "detect-video", clip, *options, *narrow)
    assert CAR.width < WIDTH / 4
    assert tally.read_text() == "".join(f"{number} 0\n" for number in range(FRAMES))
    assert len(tracks.read_text().splitlines()) == 1, "the heading alone"
    assert json.loads(cars.read_text()) == []
    again = (*options, "--overwrite", "--set", "steps=[none]")
    unknown = vdet(package, "detect-video", clip, *again, code=1)
    assert "none: unknown step; known: wide" in unknown.stderr


def test_the_command_runs_and_is_listed(package: Path, clip: Path) -> None:
    done = vdet(package, "frames", clip)
    assert done.stdout.splitlines() == [f"{number}: 1" for number in range(FRAMES)]
    assert "frames" in vdet(package, "--help").stdout


def test_the_detector_runs_through_eval_images(package: Path, tmp_path: Path) -> None:
    car = car_at(0)
    boxes = (Boxed("car", (car.x1, car.y1, car.width, car.height)),)
    write_coco(tmp_path, {"a": Labelled(WIDTH, HEIGHT, boxes)})
    (frame,) = drive(1)
    show(tmp_path / "a.png", frame.image)
    done = vdet(package, "eval", "images", tmp_path, "--set", "detector.kind=red", "--json", "-")
    values = json.loads(done.stdout)
    assert (values["detector"], values["score"], values["mean"]["f1"]) == ("red", 0, 1)


def test_all_three_run_through_a_batch(package: Path, clip: Path, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    for name in ("a", "b"):
        os.link(clip, tmp_path / "in" / f"{name}.mp4")
    vdet(
        package,
        *("detect-video", tmp_path / "in", "-d", tmp_path / "out", *CHOSEN),
        *("--sink", "tally=.txt"),
    )
    for name in ("a", "b"):
        assert len((tmp_path / "out" / f"{name}.txt").read_text().splitlines()) == FRAMES
        assert frames_of(tmp_path / "out" / f"{name}.mp4") == FRAMES
    record = json.loads((tmp_path / "out" / "manifest.jsonl").read_text().splitlines()[0])
    assert {item["sink"] for item in record["outputs"]} == {"video", "tally"}
    assert (record["model"], record["error"]) == (None, None)


def test_all_three_pass_the_checks(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(package)
    module = importlib.import_module("my_vdet")
    images = [frame.image for frame in drive(5)]
    assert images[0].shape == (HEIGHT, WIDTH, 3)
    check_detector(module.RED.load(module.RedSettings(), None), images)
    check_tracker(
        lambda width, height: module.NEAREST.make(module.NearestSettings(), width, height)
    )
    check_sink(module.TALLY, tmp_path / "tally.txt", Settings())
