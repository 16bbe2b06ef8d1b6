"""`vdet adapt`: a small model learns the road of a drawn clip."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from conftest import Run
from vdet.detect.svm.model import load_model
from vdet.synthetic.clip import write_truth
from vdet.synthetic.scene import Scene

FEW = (
    *("--set", "adapt.rounds=1", "--set", "adapt.frames=8", "--set", "mining.per_vehicle=4"),
    *("--set", "training.augmentation.mirror=false", "--jobs", "1"),
)


@pytest.fixture(scope="module")
def truth_path(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("truth") / "gt.txt"
    write_truth(path, replace(scene))
    return path


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "mine.npz"


def test_the_adapted_model_is_better_in_what_was_kept_back(
    run: Run, clip_path: Path, truth_path: Path, model_path: Path, out: Path
) -> None:
    result = run(
        *("adapt", clip_path, "-o", out, "--model", model_path),
        *("--teacher", "truth", "--truth", truth_path, *FEW),
    )
    assert result.code == 0, result.err
    report = json.loads(out.with_suffix(".json").read_text())
    f1 = {each["detector"]: each["f1"] for each in report["checks"]}
    assert tuple(f1) == (
        "base",
        "0.5 of the change, hits from 0.7",
        "1 of the change, hits from 0.7",
        "0.5 of the change, hits from 0.3",
        "1 of the change, hits from 0.3",
    )
    assert max(f1.values()) - 0.01 <= f1[report["chosen"]] > f1["base"]
    assert report["clips"][0]["learnt"] + report["clips"][0]["checked"] == 30
    assert report["clips"][0]["checked"] == 6
    assert report["rounds"][0]["vehicles"] > 10
    assert "frames kept back, as video:" in result.out
    model = load_model(out)
    assert model.camera is not None
    assert report["chosen"].endswith(f"hits from {model.camera.probability:g}")
    provenance = model.provenance
    assert provenance["report"]["clips"][0]["sha256"] == report["clips"][0]["sha256"]
    assert "base" in provenance


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("-o", "mine.onnx"), 1, "mine.onnx: models are written as .npz; name it so"),
        (("-o", "m.npz", "--teacher", "truth"), 2, "give them with --truth"),
        (("-o", "m.npz", "--truth", "a.txt", "--truth", "b.txt"), 2, "1 videos, 2 --truth"),
        (("-o", "m.npz", "--teacher", "none.npz"), 1, "none.npz: cannot be read"),
        (("-o", "m.npz", "--minutes", "0"), 2, "--minutes"),
        (("-o", "m.npz", "--set", "adapt.rounds=0"), 1, "adapt.rounds"),
    ],
)
def test_what_cannot_be_is_refused_before_any_work(
    run: Run,
    clip_path: Path,
    model_path: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    code: int,
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run("adapt", clip_path, "--model", model_path, *arguments)
    assert (result.code, result.out) == (code, "")
    assert words in result.err
    assert list(tmp_path.iterdir()) == []


def test_a_model_that_is_no_better_is_not_written(
    run: Run, clip_path: Path, truth_path: Path, model_path: Path, out: Path
) -> None:
    nothing_shown = ("--set", "tracker.least_score=1", "--set", "tracker.smallest=0.9")
    result = run(
        *("adapt", clip_path, "-o", out, "--model", model_path),
        *("--teacher", "truth", "--truth", truth_path, *FEW, *nothing_shown),
    )
    assert result.code == 1
    assert "mine.npz: is not written: in the frames kept back" in result.err
    assert list(out.parent.iterdir()) == []


@pytest.mark.parametrize(
    "row",
    [
        "1,1,1,9,9,0,3,1",  # an ignore region
        "1,300,200,9,9,1,1,1",  # a vehicle that is smaller than any window
    ],
)
def test_footage_without_a_vehicle_that_a_window_fits_is_refused(
    run: Run, clip_path: Path, model_path: Path, out: Path, tmp_path: Path, row: str
) -> None:
    truth = tmp_path / "gt.txt"
    truth.write_text("".join(f"{frame},{row}\n" for frame in range(1, 31)))
    result = run(
        *("adapt", clip_path, "-o", out, "--model", model_path),
        *("--teacher", "truth", "--truth", truth, *FEW),
    )
    assert result.code == 1
    assert "no vehicle to learn from: the teacher finds none, or none that a window" in result.err
    assert result.err.count("\n") == 1
    assert not out.exists()


def test_a_truth_that_ends_before_the_check_is_refused_before_the_learning(
    run: Run, clip_path: Path, model_path: Path, out: Path, tmp_path: Path
) -> None:
    truth = tmp_path / "gt.txt"
    truth.write_text("3,1,1,1,90,90,1,1,1\n")
    result = run(
        *("adapt", clip_path, "-o", out, "--model", model_path),
        *("--teacher", "truth", "--truth", truth, *FEW),
    )
    assert result.code == 1
    assert "covers the frames up to 3, the check begins with 25; give --minutes" in result.err
    assert result.err.count("\n") == 1
