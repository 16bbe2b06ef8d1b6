"""`vdet train`."""

import json
import zipfile
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
    assert [split["split"] for split in report["splits"]] == ["random", "tail"]
    random = report["splits"][0]
    assert random["test"]["patches"] == sum(map(sum, random["test"]["confusion"])) == 64
    assert random["test"]["accuracy"]["value"] > 0.9
    assert random["train_augmented"] > random["train_patches"], "mirror images, and some others"
    assert model.provenance["report"] == report
    for words in ("160 vehicles", "leak-free", "predicted vehicle", "vehicles/near"):
        assert words in result.out


def test_learns_the_same_from_a_zip_file(run: Run, patches_path: Path, tmp_path: Path) -> None:
    data = _small_set(tmp_path / "data", patches_path, broken=0)
    with zipfile.ZipFile(tmp_path / "set.zip", "w") as archive:
        for file in data.rglob("*.png"):
            archive.write(file, file.relative_to(data))
    options = (*QUICK, "--set", "detector.features.hog.channels=[0]")
    assert run("train", data, "-o", tmp_path / "a.npz", *options).code == 0
    assert run("train", tmp_path / "set.zip", "-o", tmp_path / "b.npz", *options).code == 0
    first, second = load_model(tmp_path / "a.npz"), load_model(tmp_path / "b.npz")
    assert (first.weights == second.weights).all()
    assert first.provenance["data_sha256"] == second.provenance["data_sha256"]


def test_an_earlier_model_is_not_lost(run: Run, patches_path: Path, tmp_path: Path) -> None:
    model = tmp_path / "m.npz"
    model.write_bytes(b"precious")
    result = run("train", patches_path, "-o", model, *QUICK)
    assert result.code == 1
    assert "--overwrite" in result.err
    assert model.read_bytes() == b"precious"


def test_data_with_one_class(run: Run, patches_path: Path, tmp_path: Path) -> None:
    result = run("train", patches_path / "vehicles", "-o", tmp_path / "m.npz")
    assert result.code == 1
    assert "no patches of the class non-vehicles" in result.err
    assert not list(tmp_path.iterdir())


def test_data_with_no_class(run: Run, tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    result = run("train", tmp_path / "data", "-o", tmp_path / "m.npz")
    assert result.code == 1
    assert "no pictures in vehicles/<group>/" in result.err


def _small_set(folder: Path, patches_path: Path, broken: int) -> Path:
    """Return a set of 160 patches, of which some are cut off."""
    files = sorted(patches_path.rglob("*.png"))[::2]
    for number, file in enumerate(files):
        target = folder / file.relative_to(patches_path)
        target.parent.mkdir(parents=True, exist_ok=True)
        data = file.read_bytes()
        target.write_bytes(data[: len(data) // 2] if number < broken else data)
    return folder


def test_a_broken_patch_is_named_and_skipped(run: Run, patches_path: Path, tmp_path: Path) -> None:
    data = _small_set(tmp_path / "data", patches_path, broken=1)
    result = run("train", data, "-o", tmp_path / "m.npz", *QUICK)
    assert result.code == 0
    assert "non-vehicles/parts/image0001.png: is no readable picture; skipped" in result.err
    assert "(1 broken ones skipped)" in result.out


def test_too_many_broken_patches_are_an_error(run: Run, patches_path: Path, tmp_path: Path) -> None:
    data = _small_set(tmp_path / "data", patches_path, broken=3)
    result = run("train", data, "-o", tmp_path / "m.npz", *QUICK)
    assert result.code == 1
    assert "3 of 160 patches are broken, more than the 1.0% of train.svm.max_broken" in result.err
    assert not (tmp_path / "m.npz").exists()


def test_a_model_is_named_npz(run: Run, patches_path: Path, tmp_path: Path) -> None:
    result = run("train", patches_path, "-o", tmp_path / "m.json")
    assert result.code == 1
    assert "models are written as .npz" in result.err


def test_no_processes_is_wrong_usage(run: Run, patches_path: Path, tmp_path: Path) -> None:
    assert run("train", patches_path, "-o", tmp_path / "m.npz", "--jobs", "0").code == 2
