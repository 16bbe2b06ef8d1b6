"""From the weights of a training to the shipped network: `make ship WEIGHTS=net.onnx`.

The weights are those of `vdet train-net`, a network or a checkpoint, also of earlier code. The
calibration of its scores comes from the results of `make unseen`: that of the networks that were
trained without what they were measured on, or, where these are not there, that of the same network.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import onnx

from benchmarks.unseen import OURS
from vdet.config.classes import our_name
from vdet.detect.onnx.detector import SHIPPED
from vdet.detect.onnx.recognition import Header, read_header
from vdet.detect.onnx.session import Session
from vdet.errors import DataError
from vdet.learn.net.export import export_network, write_model


def from_checkpoint(path: Path, output: Path) -> None:
    """Write the averaged weights of a checkpoint as a network without a calibration of its own."""
    import torch

    from vdet.learn.net.network import Network

    state: dict[str, Any] = torch.load(path, weights_only=True)
    settings = dict(state["settings"])
    network = Network(len(settings["classes"]), settings.get("channels", 1.0))
    network.load_state_dict(state["averaged"])
    sources = [{"name": name, "images": count} for name, count in settings.pop("sources")]
    base = settings.pop("base", "None")
    provenance: dict[str, Any] = {
        "training": settings,
        "report": {"sources": sources, "steps": state["step"]},
    }
    if base != "None" and Path(base).exists():
        before = read_header(Session(Path(base)))
        provenance["base"] = before.provenance if before else {}
    width, height = settings.get("size") or (settings["width"], settings["height"])
    header = Header(classes=settings["classes"], pixels=width * height, provenance=provenance)
    export_network(network, header, output, overwrite=True)


def ship(weights: Path, results: Path | None, output: Path) -> Header:
    """Write the network with its calibration, and return its header.

    Raises
    ------
    DataError
        The weights are not those of a network of ours, or the results have no calibration for it.
    """
    if weights.suffix == ".ckpt":
        from_checkpoint(weights, output)
        source = output
    else:
        source = weights
    header = read_header(Session(source))
    if header is None:
        raise DataError(f"{weights}: is not a network of vdet train-net")
    if results is not None:
        values = json.loads(results.read_text(encoding="utf-8"))
        found = values.get(OURS) or values.get(str(weights), {})
        if "calibration" not in found:
            raise DataError(f"{results}: has no calibration for {weights}")
        by_class = {
            name: found["by_class"][our_name(name) or name]
            for name in header.classes
            if (our_name(name) or name) in found["by_class"]
        }
        calibrated = {"calibration": found["calibration"], "by_class": by_class}
        header = Header.model_validate(header.model_dump() | calibrated)
    write_model(onnx.load(str(source)), header, output, overwrite=True)
    return header


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("weights", type=Path, help="network (.onnx) or checkpoint (.ckpt)")
    parser.add_argument("--results", type=Path, help="results.json of make unseen")
    parser.add_argument("--output", type=Path, default=SHIPPED, help="default: the shipped file")
    arguments = parser.parse_args()
    header = ship(arguments.weights, arguments.results, arguments.output)
    print(f"{arguments.output}: {arguments.output.stat().st_size:,} bytes")
    print(f"classes: {', '.join(header.classes)}")
    for name in header.classes:
        score = header.by_class.get(name, header.calibration)
        print(f"{name}: slope {score.slope}, offset {score.offset}")


if __name__ == "__main__":
    main()
