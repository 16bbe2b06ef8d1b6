"""`vdet train`."""

import json
from pathlib import Path

from conftest import Run
from vdet.detect.svm.model import load_model

QUICK = ("--jobs", "1")


def test_makes_a_model_and_its_metrics(run: Run, patches_path: Path, tmp_path: Path) -> None:
    result = run("train", patches_path, "-o", tmp_path / "m.npz", *QUICK)
    assert result.code == 0, result.err
    model = load_model(tmp_path / "m.npz")
    assert model.weights.shape == (1, 4800)
    report = json.loads((tmp_path / "m.json").read_text())
    assert (report["vehicles"], report["non_vehicles"]) == (160, 160)
    assert report["split"] == "random"
    assert report["test"]["patches"] == sum(map(sum, report["test"]["confusion"])) == 64
    assert report["test"]["accuracy"]["value"] > 0.9
    assert report["train_augmented"] > report["train_patches"], "mirror images, and some others"
    assert model.provenance["report"] == report
    for words in ("160 vehicles", "near-duplicates", "predicted vehicle", "vehicles/near"):
        assert words in result.out


def test_an_earlier_model_is_not_lost(run: Run, patches_path: Path, tmp_path: Path) -> None:
    model = tmp_path / "m.npz"
    model.write_bytes(b"precious")
    result = run("train", patches_path, "-o", model, *QUICK)
    assert result.code == 1
    assert "--overwrite" in result.err
    assert model.read_bytes() == b"precious"


def test_a_model_is_named_npz(run: Run, patches_path: Path, tmp_path: Path) -> None:
    result = run("train", patches_path, "-o", tmp_path / "m.json")
    assert result.code == 1
    assert "models are written as .npz" in result.err
