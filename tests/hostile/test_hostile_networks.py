"""Damaged and wicked networks through `vdet detect-image --model`."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
from onnx import numpy_helper

from detect.onnx.graphs import write_graph
from hostile.mutations import mutated
from hostile.trials import broken_promises, try_all, try_files
from vdet.detect.onnx.detector import SHIPPED

CELLS = 84  # of an input of 64×64
CONSTANT = """
wicked (float[1, 3, 64, 64] images) => (float[] output0)
<float[1] none = {0}>
{
    most = ReduceMax <keepdims = 0> (images)
    zero = Mul (most, none)
    output0 = Add (table, zero)
}
"""
"""A network that gives the same table for every picture."""
ULTRALYTICS = np.zeros((1, 84, CELLS))
NETWORKS: dict[str, tuple[npt.ArrayLike, dict[str, str], str]] = {
    "an infinite imgsz": (ULTRALYTICS, {"imgsz": "[1e999, 64]"}, "metadata cannot be read"),
    "names that are a number": (ULTRALYTICS, {"names": "5"}, "metadata cannot be read"),
    "names like a well": (ULTRALYTICS, {"names": "[" * 5000}, "metadata cannot be read"),
    "names of many signs": (ULTRALYTICS, {"names": "-" * 100_000 + "1"}, "cannot be read"),
    "no rows": (np.zeros((1, 0, 0)), {}, "has an unknown form"),
    "a single number": (0.0, {}, "has an unknown form"),
    "no numbers": (np.full((1, 84, CELLS), np.nan), {}, "not finite"),
    "endless numbers": (np.full((1, 84, CELLS), np.inf), {}, "not finite"),
    "large numbers": (np.full((1, 300, 6), 3e38), {}, "not finite"),
}


def test_wicked_networks_are_refused(tmp_path: Path, picture: Path) -> None:
    paths = []
    for number, (values, metadata, _) in enumerate(NETWORKS.values()):
        table = numpy_helper.from_array(np.array(values, np.float32), "table")
        paths.append(write_graph(tmp_path / f"{number}.onnx", CONSTANT, [table], metadata))
    trials = try_all([("detect-image", picture, "--model", path, "--json", "-") for path in paths])
    assert broken_promises(trials) == []
    for trial, (name, (_, _, words)) in zip(trials, NETWORKS.items(), strict=True):
        assert (trial.code, words in trial.err) == (1, True), (name, trial.err)


def test_damaged_networks_are_used_or_refused(tmp_path: Path, picture: Path) -> None:
    damaged = enumerate(mutated(SHIPPED.read_bytes(), seed=1, count=60))
    contents = {f"{number}.onnx": data for number, data in damaged}
    use = ("detect-image", picture, "--json", "-", "--model")
    assert len(try_files(tmp_path, contents, lambda path, _: [*use, path])) == 60
