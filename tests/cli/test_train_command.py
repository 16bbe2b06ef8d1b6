"""`vdet train`."""

from pathlib import Path

import pytest

from conftest import Run
from vdet.detect.svm.model import load_model

QUICK = ("--jobs", "1")


def test_makes_a_model_with_its_metrics(run: Run, patches_path: Path, tmp_path: Path) -> None:
    result = run("train", patches_path, "-o", tmp_path / "m.npz", *QUICK, code=0)
    model = load_model(tmp_path / "m.npz")
    assert model.weights.shape == (1, 4800)
    report = model.provenance["report"]
    assert sum(report["groups"].values()) == 320
    assert report["test"]["patches"] == sum(map(sum, report["test"]["confusion"])) == 65
    assert report["test"]["accuracy"] > 0.9
    assert report["samples"] > 2 * 255, "mirror images, and some others"
    assert [path.name for path in tmp_path.iterdir()] == ["m.npz"]
    for words in ("last patches of each folder", "predicted vehicle", "vehicles/near"):
        assert words in result.out


@pytest.mark.parametrize(
    ("name", "words"),
    [("old.npz", "already exists; use --overwrite"), ("m.json", "models must end in .npz")],
)
def test_an_output_that_cannot_be_is_refused(
    run: Run, patches_path: Path, tmp_path: Path, name: str, words: str
) -> None:
    (tmp_path / "old.npz").write_bytes(b"precious")
    result = run("train", patches_path, "-o", tmp_path / name, *QUICK)
    assert (result.code, words in result.err) == (1, True)
    assert (tmp_path / "old.npz").read_bytes() == b"precious"
