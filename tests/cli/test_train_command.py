"""`vdet train`."""

import errno
import json
from pathlib import Path

import pytest

from conftest import Run
from vdet.detect.svm.model import load_model

QUICK = ("--jobs", "1")


def test_makes_a_model_and_its_metrics(run: Run, patches_path: Path, tmp_path: Path) -> None:
    result = run("train", patches_path, "-o", tmp_path / "m.npz", *QUICK)
    assert result.code == 0, result.err
    model = load_model(tmp_path / "m.npz")
    assert model.weights.shape == (1, 4800)
    report = json.loads((tmp_path / "m.npz.json").read_text())
    assert sum(report["groups"].values()) == 320
    assert report["test"]["patches"] == sum(map(sum, report["test"]["confusion"])) == 65
    assert report["test"]["accuracy"] > 0.9
    assert report["samples"] > 2 * 255, "mirror images, and some others"
    assert model.provenance["report"] == report
    for words in ("last patches of each folder", "predicted vehicle", "vehicles/near"):
        assert words in result.out


def test_an_earlier_model_is_not_lost(run: Run, patches_path: Path, tmp_path: Path) -> None:
    model = tmp_path / "m.npz"
    model.write_bytes(b"precious")
    result = run("train", patches_path, "-o", model, *QUICK)
    assert result.code == 1
    assert "--overwrite" in result.err
    assert model.read_bytes() == b"precious"


def test_the_metrics_of_a_network_of_the_same_name_are_kept(
    run: Run, patches_path: Path, tmp_path: Path
) -> None:
    (tmp_path / "m.json").write_text("of m.onnx")
    assert run("train", patches_path, "-o", tmp_path / "m.npz", *QUICK).code == 0
    assert {path.name for path in tmp_path.iterdir()} == {"m.json", "m.npz", "m.npz.json"}
    assert (tmp_path / "m.json").read_text() == "of m.onnx"


def test_model_and_metrics_appear_together_or_not_at_all(
    run: Run, patches_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: Path, _: str) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr("vdet.cli.train.write_text", fail)
    result = run("train", patches_path, "-o", tmp_path / "m.npz", *QUICK)
    assert result.code == 1
    assert "m.npz.json: cannot be written: No space left on device" in result.err
    assert list(tmp_path.iterdir()) == []


def test_a_model_is_named_npz(run: Run, patches_path: Path, tmp_path: Path) -> None:
    result = run("train", patches_path, "-o", tmp_path / "m.json")
    assert result.code == 1
    assert "models must end in .npz" in result.err
