"""From the weights of a training to the shipped network: `make ship WEIGHTS=net.onnx`.

The weights are those of `vdet train-net`, a network or a checkpoint; with `--base`, a weighted mean
of these and of the network from which the training started. The calibration of its scores comes
from the results of `make unseen`: that of the networks that were trained without what they were
measured on, or, where these are not there, that of the same network. Without results, it is that of
the base.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import numpy_helper

from benchmarks.unseen import OURS
from vdet.config.classes import standard_class
from vdet.detect.onnx.detector import SHIPPED
from vdet.detect.onnx.network import Header, Session, read_header
from vdet.errors import DataError
from vdet.learn.net.network import export_network, write_model


def from_checkpoint(path: Path, output: Path, base: Header | None) -> None:
    """Write the averaged weights of a checkpoint as a network without a calibration of its own.

    `base` is the header of the network from which the training started.
    """
    import torch

    from vdet.learn.net.network import Network

    state: dict[str, Any] = torch.load(path, weights_only=True)
    settings = dict(state["settings"])
    network = Network(len(settings["classes"]), settings["channels"])
    network.load_state_dict(state["averaged"])
    sources = [{"name": name, "images": count} for name, count in settings.pop("sources")]
    settings.pop("base")
    report = {"sources": sources, "steps": state["step"]}
    provenance: dict[str, Any] = {"training": settings, "report": report}
    if base is not None:
        provenance["base"] = base.provenance
    width, height = settings["size"]
    header = Header(classes=settings["classes"], pixels=width * height, provenance=provenance)
    export_network(network, header, output, overwrite=True)


def mix(model: onnx.ModelProto, base: onnx.ModelProto, share: float) -> None:
    """Average the weights of a network with those of its base.

    The base may lack the last classes, and the last channels of each layer: they count as zeros
    where other channels read them. `share` is the weight of the first.

    Source: Wortsman et al., "Robust fine-tuning of zero-shot models", 2022.
    """
    for new, old in zip(_weights(model), _weights(base), strict=True):
        values, before = numpy_helper.to_array(new).copy(), numpy_helper.to_array(old)
        widened = np.zeros_like(values[: len(before)])
        widened[tuple(map(slice, before.shape))] = before
        values[: len(before)] += (1 - share) * (widened - values[: len(before)])
        new.CopyFrom(numpy_helper.from_array(values, new.name))


def _weights(model: onnx.ModelProto) -> list[onnx.TensorProto]:
    """Return the weight and bias of each convolution, in the order of the graph."""
    constants = {item.name: item for item in model.graph.initializer}
    names = [
        name for node in model.graph.node if node.op_type == "Conv" for name in node.input[1:3]
    ]
    assert len(set(names)) == len(names), "a weight that is used twice would be averaged twice"
    return [constants[name] for name in names]


def ship(
    weights: Path,
    results: Path | None,
    output: Path,
    base: Path | None = None,
    share: float = 0.5,
) -> Header:
    """Write the network with its calibration, and return its header.

    With a `base`, the weights are the mean of both, with the weight `share` for the first; results
    are those of this mean.

    Raises
    ------
    DataError
        The weights or the base are not those of a network of ours, or the results have no
        calibration for it.
    """
    before = onnx.load(str(base)) if base else None  # the output may replace it
    base_header = _header(base) if base else None
    calibrated = base_header.model_dump(include={"calibration", "by_class"}) if base_header else {}
    source = weights
    if weights.suffix == ".ckpt":
        from_checkpoint(weights, output, base_header)
        source = output
    header = _header(source)
    if results is not None:
        values = json.loads(results.read_text(encoding="utf-8"))
        found = values.get(OURS) or values.get(str(weights), {})
        if "calibration" not in found:
            raise DataError(f"{results}: has no calibration for {weights}")
        names = {name: standard_class(name) or name for name in header.classes}
        fitted = found["by_class"]
        by_class = {name: fitted[ours] for name, ours in names.items() if ours in fitted}
        calibrated = {"calibration": found["calibration"], "by_class": by_class}
    model = onnx.load(str(source))
    if before is not None and share < 1:
        mix(model, before, share)
        average = f"{share:g} of the weights after these steps, and {1 - share:g} of the base"
        calibrated["provenance"] = header.provenance | {"average": average}
    header = Header.model_validate(header.model_dump() | calibrated)
    write_model(model, header, output, overwrite=True)
    return header


def _header(path: Path) -> Header:
    """Return the header of a network of ours. Raises `DataError`."""
    header = read_header(Session(path))
    if header is None:
        raise DataError(f"{path}: is not a network of vdet train-net")
    return header


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("weights", type=Path, help="network (.onnx) or checkpoint (.ckpt)")
    parser.add_argument("--results", type=Path, help="results.json of make unseen")
    base = "network from which the training started: a mean of both is written"
    parser.add_argument("--base", type=Path, help=base)
    parser.add_argument("--share", type=float, default=0.5, help="weight of WEIGHTS in that mean")
    parser.add_argument("--output", type=Path, default=SHIPPED, help="default: the shipped file")
    arguments = parser.parse_args()
    header = ship(
        arguments.weights, arguments.results, arguments.output, arguments.base, arguments.share
    )
    print(f"{arguments.output}: {arguments.output.stat().st_size:,} bytes")
    print(f"classes: {', '.join(header.classes)}")
    for name in header.classes:
        score = header.by_class.get(name, header.calibration)
        print(f"{name}: slope {score.slope}, offset {score.offset}")


if __name__ == "__main__":
    main()
