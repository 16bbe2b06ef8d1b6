"""From a trained network to the shipped one: a mean with its base, and calibrated scores."""

import json
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip(
    "torch", reason="torch is not installed; `make nettest` installs it and runs these tests"
)

from benchmarks.ship import ship  # noqa: E402

from vdet.detect.onnx.network import Header, ScoreCalibration, Session  # noqa: E402
from vdet.learn.net.network import Network, export_network  # noqa: E402

OLD, NEW = ("car", "truck"), ("car", "truck", "other vehicle")
STEEP = ScoreCalibration(slope=2.0, offset=0.5)
IMAGE = np.random.default_rng(1).integers(0, 256, (1, 64, 96, 3), np.uint8)


@pytest.fixture
def networks(tmp_path: Path) -> tuple[Path, Path]:
    """Return the files of a base and of a network with one more class."""
    paths = tmp_path / "base.onnx", tmp_path / "new.onnx"
    export_network(network(2), Header(classes=OLD, by_class={"car": STEEP}), paths[0])
    export_network(network(3), Header(classes=NEW), paths[1])
    return paths


def network(classes: int) -> Network:
    """Return a network with random weights, none of them equal to another."""
    torch.manual_seed(classes)
    made: Network = Network(classes).eval()
    for parameter in made.parameters():
        torch.nn.init.uniform_(parameter, -0.1, 0.1)
    return made


def cells(path: Path) -> np.ndarray:
    return Session(path).run(IMAGE)[0]


def test_the_mean_lies_between_the_base_and_the_network(networks: tuple[Path, Path]) -> None:
    base, new = networks
    output = base.with_name("mean.onnx")
    ship(new, None, output, base, share=1.0)
    np.testing.assert_allclose(cells(output), cells(new), atol=1e-5)
    ship(new, None, output, base, share=0.0)
    np.testing.assert_allclose(cells(output)[..., :7], cells(base), atol=1e-4)
    header = ship(new, None, base, base, share=0.75)  # replaces the base
    assert header.by_class == {"car": STEEP}
    words = "0.75 of the weights after these steps, and 0.25 of the base"
    assert header.provenance["average"] == words


def test_a_synonym_is_calibrated_by_the_results_of_our_class(networks: tuple[Path, Path]) -> None:
    _, new = networks
    values = {"slope": 1.0, "offset": 0.0}, {"slope": 3.0, "offset": 1.0}
    found = {"calibration": values[0], "by_class": {"vehicle": values[1]}}
    results = new.with_name("results.json")
    results.write_text(json.dumps({str(new): found}), encoding="utf-8")
    header = ship(new, results, new.with_name("shipped.onnx"))
    assert header.by_class == {"other vehicle": ScoreCalibration(slope=3.0, offset=1.0)}
    assert header.calibration == ScoreCalibration(slope=1.0, offset=0.0)
