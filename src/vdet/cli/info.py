"""`vdet info`, `vdet config` and `vdet demo`: what is installed, and which settings there are."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vdet.cli.command import announce, command, print_lines, progress_bars
from vdet.cli.options import (
    PATH,
    ResultFiles,
    SettingsSource,
    facts_options,
    number_option,
    overwrite_option,
    settings_options,
)
from vdet.errors import ModelError, printable, quantity
from vdet.version import __version__
from vdet.workers import core_count

if TYPE_CHECKING:
    from vdet.config.schema import Settings


Facts = dict[str, Any]
"""Values for JSON by name; each is also a line of text."""

_ANY_SIZE = 1000, 1000
"""Size of the frames, pixels, if points are fractions."""


@command()
@click.argument("path", type=PATH, metavar="[FILE]", required=False)
@facts_options
@settings_options
def info(path: Path | None, source: SettingsSource, results: ResultFiles) -> None:
    """Describe a model or the settings of a camera, or check this machine.

    FILE is a linear model (.npz), or a network (.onnx) of vdet or of another tool; --json also
    writes how it was trained. Without FILE, checks the lines, zones and ground points of the
    settings (-c), and prints how well the points fit. With neither, loads the shipped models.

    \b
    Examples:
      vdet info model.npz --json -
      vdet info -c gate.yaml
      vdet info
    """
    results.check(source.inputs(*([path] if path else ())))
    settings = source.load()
    if path:
        read = _MODELS.get(path.suffix.lower())
        if not read:
            raise ModelError(f"{path}: must be .npz or .onnx; ffprobe describes videos and images")
        facts = {"file": str(path), **read(path)}
    elif source.configs:
        facts = {"file": " ".join(source.configs), **_camera(settings)}
    else:
        facts = _machine()
    lines = [
        f"{name.replace('_', ' ')}: {_value_text(value)}"
        for name, value in facts.items()
        if name != "provenance"
    ]
    results.print(lines, facts)


def _machine() -> Facts:
    """Load the shipped models; any error of that is one of the installation."""
    from vdet.config.loading import load_settings, shipped_configs
    from vdet.detect.detectors import load_detector
    from vdet.detect.onnx.detector import SHIPPED

    configs = shipped_configs()
    for path in configs.values():
        load_detector(load_settings([path]).detector)
    return {
        "vdet": f"{__version__}, on {core_count()} cores",
        "network": str(SHIPPED),
        "settings": list(configs),
    }


def _camera(settings: "Settings") -> Facts:
    """Return lines, zones and the fit of the ground points in the settings of a camera."""
    from vdet.lanes.camera import ground_of
    from vdet.traffic.crossings import lines_and_zones

    size = settings.camera.size or _ANY_SIZE
    lines, zones = lines_and_zones(settings.traffic, *size)
    facts: Facts = {
        "kind": "settings of a camera",
        "lines": [line.name for line in lines],
        "zones": [zone.name for zone in zones],
        "ground": None,
    }
    if ground := ground_of(settings.camera, *size):
        pixels = f"{ground.pixel_error:.1f} px, " if settings.camera.size else ""
        facts["ground"] = (
            f"{quantity(len(settings.camera.ground), 'point')}, off by {ground.error:.2f} m "
            f"({pixels}root mean square), over {ground.length:.0f} m"
        )
    return facts


def _value_text(value: Any) -> str:
    if isinstance(value, list):
        return "; ".join(map(printable, value)) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "unknown" if value is None else str(value)


def _linear_model(path: Path) -> Facts:
    from vdet.detect.svm.model import load_model

    model = load_model(path)
    return {
        "kind": "linear model of vdet",
        "features": model.weights.shape[1],
        "patch": model.features.patch,
        "learnt_boxes": model.box_regression is not None,
        "provenance": model.provenance,
    }


def _network(path: Path) -> Facts:
    from vdet.config.classes import standard_class
    from vdet.detect.onnx.network import Session, recognize

    network = recognize(Session(path)).for_frames(1280, 720)
    return {
        "kind": "network",
        "form": network.name,
        "input_for_1280x720": f"{network.form.width}x{network.form.height}",
        "classes": [name for name in network.names if standard_class(name)],
        "other_classes": [name for name in network.names if not standard_class(name)],
        "provenance": network.header.provenance if network.header else {},
    }


_MODELS = {".npz": _linear_model, ".onnx": _network}


@command()
@settings_options
def config(source: SettingsSource) -> None:
    """Print the effective settings as commented YAML.

    Save them, change what you like, and pass the file to a command with -c.

    \b
    Examples:
      vdet config > my.yaml
      vdet config -c seed --set output.crf=18
    """
    from vdet.config.loading import render_settings

    print_lines(*render_settings(source.load()).splitlines())


@command()
@click.argument("folder", default=Path("demo"), type=PATH, metavar="[DIR]")
@number_option("--seed", type=click.IntRange(min=0), default=5, help="Seed of the random scenes.")
@overwrite_option
def demo(folder: Path, seed: int, overwrite: bool) -> None:
    """Try the whole program on synthetic roads.

    Draws two roads with vehicles, from a moving camera and from a pole. The network finds the
    vehicles, and counts those seen from the pole. Then a linear model, trained on patches of other
    synthetic roads, finds them too. All results are compared with the ground truth, and written
    into DIR, by default demo.

    \b
    Examples:
      vdet demo folder --seed 2 --overwrite
    """
    from vdet.demo import run_demo

    with progress_bars("") as progress:
        lines = run_demo(
            folder, seed=seed, overwrite=overwrite, announce=announce, progress=progress
        )
    print_lines(
        *lines,
        "",
        f"All files are in {folder}: found.mp4 and page/page.html are worth a look.",
        "Next, try your own video:  vdet detect-video in.mp4",
    )
