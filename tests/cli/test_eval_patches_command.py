"""`vdet eval patches`."""

import json
from pathlib import Path

from conftest import Run

QUICK = ("--set", "train.svm.C=0.001", "--set", "train.svm.augmentation=false")


def test_trains_a_model_and_tests_it(run: Run, patches_path: Path, tmp_path: Path) -> None:
    target = tmp_path / "p.json"
    result = run("eval", "patches", patches_path, "--json", target, *QUICK, code=0)
    for words in ("patches tested: 65", "leak-free", "precision", "predicted non-vehicle"):
        assert words in result.out
    found = json.loads(target.read_text())
    assert found["test"]["patches"] == 65
    assert found["test"]["accuracy"] > 0.9


def test_measures_a_ready_model_on_everything(
    run: Run, patches_path: Path, model_path: Path
) -> None:
    options = ("--model", model_path, "--json", "-")
    result = run("eval", "patches", patches_path, *options, code=0)
    found = json.loads(result.out)
    assert found["test"]["patches"] == 320
    assert "if the model was trained on some of these patches" in found["meaning"]
    assert "recall" in result.err, "the table makes room on standard output"
