"""Damaged and wicked networks through `vdet detect-image --model`."""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from detect.onnx.graphs import write_graph
from hostile.mutations import mutated
from hostile.trials import broken_promises, try_all, try_files
from vdet.detect.onnx.detector import SHIPPED

CELLS = 84  # of an input of 64×64
Write = Callable[[Path], Path]


def constant(
    values: object, *, shape: Sequence[str | int | None] = (1, 3, 64, 64), **metadata: str
) -> Write:
    """Return what writes a network that gives the same table for every picture."""

    def write(path: Path) -> Path:
        nodes = [
            helper.make_node("ReduceMax", ["images"], ["most"], keepdims=0),
            helper.make_node("Mul", ["most", "none"], ["zero"]),
            helper.make_node("Add", ["table", "zero"], ["output0"]),
        ]
        constants = [
            numpy_helper.from_array(np.array(values, np.float32), "table"),
            numpy_helper.from_array(np.zeros(1, np.float32), "none"),
        ]
        return write_graph(path, nodes, [picture(shape)], [table("output0")], constants, metadata)

    return write


def picture(shape: Sequence[str | int | None]) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info("images", TensorProto.FLOAT, shape)


def table(name: str) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, None)


ULTRALYTICS = np.zeros((1, 84, CELLS))
NETWORKS: Mapping[str, tuple[Write, str]] = {
    "an infinite imgsz": (constant(ULTRALYTICS, imgsz="[1e999, 64]"), "metadata cannot be read"),
    "names that are a number": (constant(ULTRALYTICS, names="5"), "metadata cannot be read"),
    "names like a well": (constant(ULTRALYTICS, names="[" * 5000), "metadata cannot be read"),
    "names of many signs": (constant(ULTRALYTICS, names="-" * 100_000 + "1"), "cannot be read"),
    "no rows": (constant(np.zeros((1, 0, 0))), "has an unknown form"),
    "a single number": (constant(0.0), "has an unknown form"),
    "no numbers": (constant(np.full((1, 84, CELLS), np.nan)), "not finite"),
    "endless numbers": (constant(np.full((1, 84, CELLS), np.inf)), "not finite"),
    "large numbers": (constant(np.full((1, 300, 6), 3e38)), "not finite"),
}


@pytest.fixture(scope="module")
def noise(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("picture") / "noise.png"
    cv2.imwrite(str(path), np.random.default_rng(0).integers(0, 256, (90, 160, 3), np.uint8))
    return path


def test_wicked_networks_are_used_or_refused(tmp_path: Path, noise: Path) -> None:
    writers = enumerate(NETWORKS.values())
    paths = [write(tmp_path / f"{number}.onnx") for number, (write, _) in writers]
    trials = try_all([("detect-image", noise, "--model", path, "--json", "-") for path in paths])
    assert broken_promises(trials) == []
    for trial, (name, (_, words)) in zip(trials, NETWORKS.items(), strict=True):
        assert trial.code == (1 if words else 0), (name, trial.err)
        assert re.search(words, trial.err), (name, trial.err)


def test_damaged_networks_are_used_or_refused(tmp_path: Path, noise: Path) -> None:
    damaged = enumerate(mutated(SHIPPED.read_bytes(), seed=1, count=60))
    contents = {f"{number}.onnx": data for number, data in damaged}
    use = ("detect-image", noise, "--json", "-", "--model")
    assert len(try_files(tmp_path, contents, lambda path, _: [*use, path])) == 60
