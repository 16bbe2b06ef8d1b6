"""`vdet demo`, and the steps that it makes."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from conftest import Run
from quick import QUICK, only_windows
from vdet.cli.demo import DemoFiles, DemoResult, check_demo, run_demo
from vdet.config.loading import load_settings
from vdet.config.schema import Settings
from vdet.detect.svm.model import load_model
from vdet.errors import OutputError
from vdet.evaluate.predictions import read_predictions
from vdet.evaluate.truth import read_truth
from vdet.media import VideoReader
from vdet.synthetic import demo_scene
from vdet.synthetic.scene import Scene

PATCHES = 400
FRAMES = 30
FEW_WINDOWS = only_windows("size: 128, overlap: 0.7, top: 370, bottom: 600")


def short_clip(seed: int) -> Scene:
    return replace(demo_scene(seed, width=320, height=180), frames=FRAMES)


@dataclass(frozen=True)
class Demo:
    files: DemoFiles
    result: DemoResult
    steps: list[str]
    totals: list[tuple[str, int | None]]


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    """A demo with few patches and a short clip."""
    files = DemoFiles(tmp_path_factory.mktemp("demo") / "new" / "demo")
    steps: list[str] = []
    totals: list[tuple[str, int | None]] = []

    def start(what: str, total: int | None) -> Callable[[int], object]:
        totals.append((what, total))
        return lambda _: None

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vdet.cli.demo.PATCHES", PATCHES)
        patch.setattr("vdet.cli.demo.demo_scene", short_clip)
        settings = load_settings(None, QUICK)
        result = run_demo(files, settings, report_step=steps.append, steps=start)
    return Demo(files, result, steps, totals)


def test_every_file_it_names_is_there(done: Demo) -> None:
    files = done.files
    for path in (files.clip, files.truth, files.model, files.report, files.result, files.tracks):
        assert path.stat().st_size > 0
    assert len(list(files.stages.glob("*.png"))) == 5
    assert len(list(files.patches.rglob("*.png"))) == 2 * PATCHES


def test_nothing_else_is_left(done: Demo) -> None:
    names = {path.name for path in done.files.folder.iterdir()}
    assert names == {
        "patches", "road.mp4", "truth.txt", "model.npz", "model.json", "found.mp4", "found.jsonl",
        "stages",
    }  # fmt: skip


def test_the_whole_clip_is_searched(done: Demo) -> None:
    assert done.result.frames == FRAMES
    assert done.result.seconds > 0
    for path in (done.files.clip, done.files.result):
        with VideoReader(path) as reader:
            assert sum(1 for _ in reader) == FRAMES


def test_vehicles_are_found(done: Demo) -> None:
    scores = done.result.scores
    shares = (scores.precision, scores.recall, scores.f1, scores.idf1)
    assert all(0 <= share <= 1 for share in shares)
    assert scores.recall > 0.5
    assert scores.precision > 0.35


def test_the_model_classifies_the_patches(done: Demo) -> None:
    assert {split.split for split in done.result.training.splits} == {"random", "tail"}
    for split in done.result.training.splits:
        assert 0.85 < split.test_accuracy <= 1
    assert load_model(done.files.model).features == Settings().svm.features


def test_tracks_and_truth_can_be_scored_again(done: Demo) -> None:
    assert read_predictions(done.files.tracks)
    assert read_truth(done.files.truth)


def test_each_step_is_reported(done: Demo) -> None:
    assert [line[:3] for line in done.steps] == ["1/4", "2/4", "3/4", "4/4"]
    assert f"{2 * PATCHES} patches" in done.steps[0]
    assert [what for what, _ in done.totals] == [
        "drawing",
        "describing patches",
        "fitting the classifier, random split",
        "fitting the classifier, tail split",
        "timing the classifier",
        "frames",
    ]
    assert [total for _, total in done.totals if total] == [2 * PATCHES, FRAMES]


@pytest.mark.parametrize(
    "name", ["road.mp4", "truth.txt", "model.npz", "model.json", "found.mp4", "found.jsonl"]
)
def test_an_earlier_demo_is_not_written_over(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    with pytest.raises(OutputError, match=f"{name}: is there already; give --overwrite"):
        check_demo(DemoFiles(tmp_path), overwrite=False)
    check_demo(DemoFiles(tmp_path), overwrite=True)


def test_earlier_stage_pictures_are_not_written_over_either(tmp_path: Path) -> None:
    (tmp_path / "stages").mkdir()
    (tmp_path / "stages" / "5-boxes.png").touch()
    with pytest.raises(OutputError, match=r"5-boxes\.png: is there already; give --overwrite"):
        check_demo(DemoFiles(tmp_path), overwrite=False)
    check_demo(DemoFiles(tmp_path), overwrite=True)


def test_the_folder_may_be_new_or_empty(tmp_path: Path) -> None:
    check_demo(DemoFiles(tmp_path), overwrite=False)
    check_demo(DemoFiles(tmp_path / "new" / "demo"), overwrite=False)
    assert (tmp_path / "new" / "demo").is_dir()


def test_a_file_is_no_folder_for_a_demo(tmp_path: Path) -> None:
    (tmp_path / "demo").touch()
    with pytest.raises(OutputError, match="cannot be made a folder"):
        check_demo(DemoFiles(tmp_path / "demo"), overwrite=False)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vdet.cli.demo.PATCHES", 60)
    monkeypatch.setattr(
        "vdet.cli.demo.demo_scene", lambda seed: replace(short_clip(seed), frames=FRAMES // 2)
    )


@pytest.mark.usefixtures("small")
def test_says_what_it_measured_and_where_to_look(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "demo"
    result = run("demo", folder, *FEW_WINDOWS)
    assert result.code == 0, result.err
    for split in ("random", "tail"):
        assert re.search(rf"patches, {split} split: test accuracy [01]\.\d{{3}}", result.out)
    assert f"video: {FRAMES // 2} frames in " in result.out
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
