"""`vdet eval patches`."""

import json
from pathlib import Path

import pytest

from conftest import Run

QUICK = (
    *(
        "--set",
        "train.svm.C=0.001",
        "--set",
        "train.svm.augmentation={mirror: false, cut: 0, parts: 0}",
    ),
    *("--jobs", "1"),
)


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vdet.learn.svm.patch_eval.metrics.RESAMPLES", 20)


def test_trains_a_model_for_a_split(run: Run, patches_path: Path, tmp_path: Path) -> None:
    target, folder = tmp_path / "p.json", tmp_path / "page"
    options = ("--split", "tail", "--json", target, "--page", folder)
    result = run("eval", "patches", patches_path, *options, *QUICK)
    assert result.code == 0, result.err
    for words in ("160 vehicles, 160 non-vehicles", "leak-free", "calibration error", "["):
        assert words in result.out
    (trial,) = json.loads(target.read_text())["trials"]
    assert (trial["name"], trial["scores"]["patches"]) == ("tail", 65)
    assert trial["scores"]["accuracy"] > 0.9
    html = (folder / "page.html").read_text()
    for words in ("Curves", "Accuracy by group", "Worst mistakes: tail", "data:image/svg+xml"):
        assert words in html


def test_measures_a_ready_model_on_everything(
    run: Run, patches_path: Path, model_path: Path
) -> None:
    options = ("--model", model_path, "--json", "-", "--jobs", "1")
    result = run("eval", "patches", patches_path, *options)
    assert result.code == 0, result.err
    (trial,) = json.loads(result.out)["trials"]
    assert trial["scores"]["patches"] == 320
    assert "was trained on most of these very patches" in trial["meaning"]
    assert "ROC AUC" in result.err, "the table makes room on standard output"


def test_a_model_and_a_split_exclude_each_other(
    run: Run, patches_path: Path, model_path: Path
) -> None:
    result = run("eval", "patches", patches_path, "--model", model_path, "--split", "tail")
    assert result.code == 2
    assert "--split trains new models" in result.err


def test_earlier_numbers_are_kept(run: Run, patches_path: Path, tmp_path: Path) -> None:
    target = tmp_path / "p.json"
    target.write_text("precious")
    result = run("eval", "patches", patches_path, "--json", target)
    assert result.code == 1
    assert "is there already; give --overwrite" in result.err
    assert target.read_text() == "precious"
