"""`vdet info` describes files, cameras and this machine; `vdet config` prints settings."""

import math
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vdet.cli.command import command
from vdet.cli.messages import print_lines
from vdet.cli.options import INPUT, SettingsSource, settings_options
from vdet.cli.results import ResultFiles, facts_options
from vdet.errors import counted, in_one_line, opencv_fault, printable
from vdet.version import __version__
from vdet.workers import core_count

if TYPE_CHECKING:
    from vdet.config.schema import Settings

Facts = dict[str, Any]
"""Values for JSON by name; each is also a line of text."""

_BROKEN = "broken"
_SPEED = 50
"""Speed whose error is printed for positions that are off by a pixel, km/h."""
_ANY_SIZE = 1000, 1000
"""Size of the frames, pixels, if points are fractions."""


@command()
@click.argument("path", type=INPUT, metavar="[FILE]", required=False)
@facts_options
@settings_options()
def info(path: Path | None, source: SettingsSource, results: ResultFiles) -> int:
    """Describe a video, image, model or camera, or check this machine.

    FILE is a video, numbered images, an image, a linear model (.npz), or a network (.onnx) of vdet
    or of another tool. For a model, --json also writes how it was trained. Without FILE, checks the
    lines, zones and ground points of the settings (-c), and prints the effect of an error of one
    pixel on speeds. With neither, checks packages, codecs and the shipped models; the exit code is
    1 if something that vdet needs does not work.

    \b
    Examples:
      vdet info in.mp4
      vdet info model.npz --json -
      vdet info -c gate.yaml
      vdet info
    """
    from vdet.media.images import video_files

    results.check(source.inputs(*(video_files(path) if path else ())))
    settings = source.load()
    if path:
        facts = {"file": str(path), **_file(path, settings)}
    elif source.configs:
        facts = {"file": " ".join(source.configs), **_camera(settings)}
    else:
        facts = _machine()
    lines = [
        f"{name.replace('_', ' ')}: {_text(value)}"
        for name, value in facts.items()
        if name != "provenance"
    ]
    results.print(lines, facts)
    return int(facts.get("works") is False)


def _file(path: Path, settings: "Settings") -> Facts:
    from vdet.media.images import is_image_file

    if path.suffix.lower() == ".npz":
        return _linear_model(path)
    if path.suffix.lower() == ".onnx":
        return _network(path)
    if is_image_file(path):
        return _image(path)
    return _video(path, settings)


def _machine() -> Facts:
    """Return the state of everything that vdet needs, and whether all of it works."""
    from vdet.config.loading import shipped_configs

    states = {"vdet": f"{__version__}, on {core_count()} cores", **dict(_packages())}
    states["cv2"] = f"{_BROKEN}; {fault}" if (fault := opencv_fault()) else "ok"
    states["codec h264"] = _checked(_codec)
    for name, path in shipped_configs().items():
        states[f"settings {name}"] = _checked(partial(_shipped, path))
    return states | {"works": not any(text.startswith(_BROKEN) for text in states.values())}


def _packages() -> Iterator[tuple[str, str]]:
    """Yield the packages that vdet needs, and those of each extra, with their versions."""
    from importlib.metadata import PackageNotFoundError, requires, version

    for requirement in requires("vdet") or ():
        package = re.split(r"[^\w.-]", requirement)[0]
        extra = re.search(r"extra == .(\w+)", requirement)
        if extra and extra[1] == "dev":
            continue
        name = f"{package} (extra {extra[1]})" if extra else package
        try:
            yield name, version(package)
        except PackageNotFoundError:
            yield name, f"{'not installed' if extra else _BROKEN}; pip install {package}"


def _checked(check: Callable[[], str]) -> str:
    try:
        return check()
    except Exception as error:  # any error means that it does not work
        return f"{_BROKEN}; {in_one_line(error)}; install vdet again"


def _codec() -> str:
    import av

    av.Codec("libx264", "w")
    av.Codec("h264", "r")
    return "ok"


def _shipped(path: Path) -> str:
    from vdet.config.loading import load_settings
    from vdet.detect.factory import load_detector

    load_detector(load_settings([path]).detector)
    return f"{path}, its model loads"


def _camera(settings: "Settings") -> Facts:
    """Return lines, zones and the fit of the ground points in the settings of a camera."""
    from vdet.lanes.ground import ground_of
    from vdet.traffic.crossings import lines_and_zones
    from vdet.traffic.speeds import KMH, precision_at

    size = settings.camera.size or _ANY_SIZE
    lines, zones = lines_and_zones(settings.traffic, *size)
    facts: Facts = {
        "kind": "settings of a camera",
        "lines": [line.name for line in lines],
        "zones": [zone.name for zone in zones],
        "ground": None,
    }
    if (ground := ground_of(settings.camera, *size)) is None:
        return facts
    facts["ground"] = (
        f"{counted(len(settings.camera.ground), 'point')}, off by {ground.error:.2f} m "
        f"({ground.pixel_error:.1f} px, root mean square), over {ground.length:.0f} m"
    )
    for line in lines:
        across, along, error = precision_at(line, ground, _SPEED / KMH)
        facts[f"at {line.name}"] = (
            f"a pixel is {across:.3f} × {along:.3f} m, {_SPEED} km/h ± {100 * error:.1f} %"
            if math.isfinite(along)
            else "too far from the points of the ground, no speeds"
        )
    return facts


def _text(value: Any) -> str:
    if isinstance(value, list):
        return "; ".join(map(printable, value)) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    return "unknown" if value is None else str(value)


def _linear_model(path: Path) -> Facts:
    from vdet.detect.svm.detector import trained_on
    from vdet.detect.svm.model import load_model

    model = load_model(path)
    return {
        "kind": "linear model of vdet",
        "features": model.weights.shape[1],
        "patch": model.features.patch,
        "learnt_boxes": model.box_regression is not None,
        "trained_on": list(trained_on(path)),
        "provenance": model.provenance,
    }


def _network(path: Path) -> Facts:
    from vdet.config.classes import our_name
    from vdet.detect.onnx.detector import trained_on
    from vdet.detect.onnx.recognition import recognize
    from vdet.detect.onnx.session import Session

    network = recognize(Session(path)).for_frames(1280, 720)
    return {
        "kind": "network",
        "form": network.name,
        "input_for_1280x720": f"{network.form.width}x{network.form.height}",
        "classes": [name for name in network.names if our_name(name)],
        "other_classes": [name for name in network.names if not our_name(name)],
        "trained_on": list(trained_on(path)),
        "provenance": network.header.provenance if network.header else {},
    }


def _image(path: Path) -> Facts:
    from vdet.media.images import read_image

    height, width = read_image(path).shape[:2]
    return {"kind": "image", "width": width, "height": height}


def _video(path: Path, settings: "Settings") -> Facts:
    from vdet.media.reader import VideoReader
    from vdet.traffic.clock import find_clock

    with VideoReader(path, settings=settings.input) as reader:
        video = reader.info
    clock = find_clock(path, settings, float(video.start), tags=video.tags, length=video.duration)
    return {
        "kind": "video",
        "width": video.width,
        "height": video.height,
        "rate": float(video.rate),
        "declared_frames": video.frames,
        "seconds": None if video.duration is None else float(video.duration),
        "begins": clock and str(clock),
    }


@command()
@settings_options()
def config(source: SettingsSource) -> None:
    """Print the effective settings as commented YAML.

    Save them, change what you like, and pass the file to a command with -c.

    \b
    Examples:
      vdet config > my.yaml
      vdet config -c seed --set output.crf=18
    """
    from vdet.config.rendering import render_settings

    print_lines(*render_settings(source.load()).splitlines())
