"""What `vdet info` says of a model file."""

import json
from pathlib import Path
from typing import Any

from vdet.cli.options import Facts
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


def linear_facts(path: Path) -> Facts:
    """Describe a linear model. Raises `ModelError`."""
    model = load_model(path)
    features, learnt = model.weights.shape[1], model.box_regression is not None
    lines = [
        f"{path}: a linear model of vdet",
        f"features: {features} of patches {model.features.patch} pixels wide",
        f"sides of boxes: {'learnt' if learnt else 'those of the windows'}",
        *_provenance(model.provenance),
    ]
    values = {
        "file": str(path),
        "kind": "linear model",
        "features": features,
        "patch": model.features.patch,
        "learnt_boxes": learnt,
        "provenance": model.provenance,
    }
    return Facts(lines, values)


def network_facts(path: Path) -> Facts:
    """Describe a network. Raises `ModelError`."""
    found = recognize(Session(path), path).for_frames(1280, 720)
    form = found.form
    known = {name: our_name(name) for name in found.names}
    vehicles = {name: ours for name, ours in known.items() if ours is not None}
    others = [name for name, ours in known.items() if ours is None]
    provenance = found.header.provenance if found.header is not None else {}
    named = [
        printable(name) if name == ours else f"{printable(name)} ({ours})"
        for name, ours in vehicles.items()
    ]
    lines = [
        f"{path}: a network of the form {found.name}",
        *(f"  {reason}" for reason in found.reasons),
        (
            f"input: {form.width}×{form.height} for a frame of 1280×720, "
            f"{'RGB' if form.is_rgb else 'BGR'} up to {255 * form.factor:g}, {_FITS[form.fit]}"
        ),
        f"vehicles: {', '.join(named) or 'none'}",
        f"other classes: {', '.join(map(printable, others)) or 'none'}",
        *_provenance(provenance),
    ]
    values = {
        "file": str(path),
        "kind": "network",
        "form": found.name,
        "reasons": list(found.reasons),
        "input": [form.width, form.height],
        "vehicles": vehicles,
        "other_classes": others,
        "provenance": provenance,
    }
    return Facts(lines, values)


def _provenance(provenance: dict[str, Any]) -> list[str]:
    return [
        f"{key}: {value if isinstance(value, str) else json.dumps(value)}"
        for key, value in provenance.items()
    ]
