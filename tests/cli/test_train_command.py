"""`vdet train`."""

from pathlib import Path

from conftest import Run
from vdet.detect.svm.model import load_model


def test_makes_a_model_with_its_metrics(run: Run, patches_path: Path, tmp_path: Path) -> None:
    result = run("train", patches_path, "-o", tmp_path / "m.npz", "--jobs", "1", code=0)
    model = load_model(tmp_path / "m.npz")
    assert model.weights.shape == (1, 4800)
    report = model.provenance["report"]
    assert sum(report["groups"].values()) == 320
    assert report["test"]["patches"] == sum(map(sum, report["test"]["confusion"])) == 64
    assert report["test"]["accuracy"] > 0.9
    assert report["samples"] > 2 * 256, "mirror images, and some others"
    assert [path.name for path in tmp_path.iterdir()] == ["m.npz"]
    for words in ("last patches of each folder", "predicted vehicle", "vehicles/near"):
        assert words in result.out
