"""`vdet info`: what a model file is."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from vdet.cli.command import Command
from vdet.cli.messages import print_lines
from vdet.cli.options import PATH
from vdet.detect.classes import our_name
from vdet.detect.onnx.recognition import recognize
from vdet.detect.onnx.session import Session
from vdet.detect.svm.model import load_model
from vdet.files import printable

_FITS = {
    "stretch": "stretched to this size",
    "center": "with grey around it, in the middle",
    "corner": "with grey around it, at the top left",
}


@click.command(cls=Command, examples=("vdet info model.npz", "vdet info yolox_nano.onnx"))
@click.argument("model", type=PATH, metavar="MODEL")
def info(model: Path) -> None:
    """Say what a model file is: what it wants, what it finds, what it was trained on.

    MODEL is a linear model (.npz), or a network (.onnx) of vdet or of another tool.
    """
    lines = _network_lines(model) if model.suffix.lower() == ".onnx" else _linear_lines(model)
    print_lines(*lines)


def _linear_lines(path: Path) -> Iterator[str]:
    model = load_model(path)
    yield f"{path}: a linear model of vdet"
    yield f"features: {model.weights.shape[1]} of patches {model.features.patch} pixels wide"
    yield f"sides of boxes: {'learnt' if model.box_regression else 'those of the windows'}"
    yield from _provenance(model.provenance)


def _network_lines(path: Path) -> Iterator[str]:
    found = recognize(Session(path), path).for_frames(1280, 720)
    yield f"{path}: a network of the form {found.name}"
    for reason in found.reasons:
        yield f"  {reason}"
    form = found.form
    yield (
        f"input: {form.width}×{form.height} for a frame of 1280×720, "
        f"{'RGB' if form.is_rgb else 'BGR'} up to {255 * form.factor:g}, {_FITS[form.fit]}"
    )
    known = {name: our_name(name) for name in found.names}
    vehicles = [
        printable(name) if name == ours else f"{printable(name)} ({ours})"
        for name, ours in known.items()
        if ours is not None
    ]
    others = [printable(name) for name, ours in known.items() if ours is None]
    yield f"vehicles: {', '.join(vehicles) or 'none'}"
    yield f"other classes: {', '.join(others) or 'none'}"
    if found.header is not None:
        yield from _provenance(found.header.provenance)


def _provenance(provenance: dict[str, Any]) -> Iterator[str]:
    for key, value in provenance.items():
        yield f"{key}: {value if isinstance(value, str) else json.dumps(value)}"
