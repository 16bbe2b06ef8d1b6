"""`vdet doctor`: whether the program can work here, and what it finds."""

import os
import platform
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from fractions import Fraction
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

import av
import click
import cv2
import numpy as np

import vdet
from vdet.cli.command import Command
from vdet.cli.options import Facts, facts_options, print_facts
from vdet.config.loading import load_settings, shipped_configs
from vdet.detect.factory import load_detector
from vdet.errors import VdetError, in_one_line
from vdet.files import check_output
from vdet.version import __version__
from vdet.workers import core_count

Status = Literal["ok", "absent", "broken"]

EXTRAS = {
    "dask": ("dask", "distributed"),
    "train": ("onnx", "torch"),
}
"""The packages of each extra, as `pyproject.toml` has them."""

NEEDED = (
    *("onnxruntime", "scipy", "scikit-learn", "pydantic", "click", "PyYAML", "joblib", "loky"),
    *("pillow", "threadpoolctl", "tqdm", "Jinja2"),
)
DECODERS = ("h264", "hevc", "av1", "vp9", "mpeg4", "mjpeg")
DATA = ("vehicles.zip", "non-vehicles.zip", "project_video.mp4")
_GIGABYTE = 1e9


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at.

    Attributes
    ----------
    status
        "ok"; "absent" where the program works without it; "broken" where it does not work.
    """

    name: str
    status: Status
    text: str


@click.command(cls=Command, examples=("vdet doctor", "vdet doctor --json -"))
@facts_options
def doctor(json_target: str | None, overwrite: bool) -> int:
    """Say whether vdet can work here: versions, cores, memory, codecs, extras, models.

    The exit code is 1 where something that it needs does not work.
    """
    if json_target not in (None, "-"):
        check_output(Path(json_target), overwrite=overwrite)
    findings = [finding for look in LOOKS for finding in look()]
    works = all(finding.status != "broken" for finding in findings)
    width = max(len(finding.status) for finding in findings)
    lines = [f"{each.status:{width}}  {each.name}: {each.text}" for each in findings]
    lines.append("vdet can work here" if works else "vdet cannot work here: see what is broken")
    values = {"works": works, "findings": [asdict(finding) for finding in findings]}
    print_facts(Facts(lines, values), json_target, overwrite=overwrite)
    return 0 if works else 1


def find_programs() -> Iterator[Finding]:
    """Look at the versions of the program and of what it needs."""
    system = f"{platform.system()} {platform.machine()}"
    yield Finding("vdet", "ok", f"{__version__}, {Path(vdet.__file__).parent}")
    yield Finding("Python", "ok", f"{platform.python_version()}, {sys.executable}, {system}")
    if hasattr(cv2, "HOGDescriptor"):
        yield Finding("OpenCV", "ok", cv2.__version__)
    else:
        text = f"{cv2.__version__} has no HOGDescriptor; install 'opencv-python-headless<5'"
        yield Finding("OpenCV", "broken", text)
    yield Finding("PyAV", "ok", f"{av.__version__} with FFmpeg {av.ffmpeg_version_info}")
    yield Finding("numpy", "ok", np.__version__)
    for name in NEEDED:
        found = _version(name)
        text = found or f"not installed; pip install {name}"
        yield Finding(name, "ok" if found else "broken", text)


def find_machine() -> Iterator[Finding]:
    """Look at cores and memory."""
    yield Finding("cores", "ok", f"{core_count()} for this process")
    with suppress(ValueError, OSError, AttributeError):
        page = os.sysconf("SC_PAGE_SIZE") / _GIGABYTE
        total, free = (os.sysconf(f"SC_{kind}PHYS_PAGES") * page for kind in ("", "AV"))
        yield Finding("memory", "ok", f"{total:.1f} GB, of which {free:.1f} GB are not in use")


def find_codecs() -> Iterator[Finding]:
    """Try the encoder, and look for decoders."""
    try:
        _encode()
    except (av.FFmpegError, ValueError) as error:
        text = f"cannot be opened ({error}); install av from PyPI"
        yield Finding("encoder libx264", "broken", text)
    else:
        yield Finding("encoder libx264", "ok", "writes video")
    there = [name for name in DECODERS if _can_decode(name)]
    status: Status = "ok" if "h264" in there else "broken"
    missing = [name for name in DECODERS if name not in there]
    text = ", ".join(there) + (f"; without {', '.join(missing)}" if missing else "")
    yield Finding("decoders", status, text)


def find_extras() -> Iterator[Finding]:
    """Look for the packages of the extras."""
    for extra, packages in EXTRAS.items():
        found = {package: _version(package) for package in packages}
        there = [f"{package} {number}" for package, number in found.items() if number]
        missing = [package for package, number in found.items() if not number]
        name = f"extra {extra}"
        if missing:
            text = f"needs {', '.join(missing)}; pip install {' '.join(missing)}"
            yield Finding(name, "absent", text)
        else:
            yield Finding(name, "ok", ", ".join(there))


def find_models() -> Iterator[Finding]:
    """Load each shipped file of settings, and the model that it names."""
    configs = shipped_configs()
    if not configs:
        yield Finding("configs", "broken", "there are none; install vdet again")
    for name, path in configs.items():
        try:
            load_detector(load_settings(path).detector)
        except (VdetError, OSError, ValueError) as error:
            text = f"{in_one_line(error)}; install vdet again"
            yield Finding(f"config {name}", "broken", text)
        else:
            yield Finding(f"config {name}", "ok", f"{path}, its model loads")


def find_data() -> Iterator[Finding]:
    """Look for the data set that some tests and benchmarks need."""
    place = os.environ.get("VDET_DATA")
    if not place:
        yield Finding("VDET_DATA", "absent", "not set; only training and some tests need data")
        return
    missing = [name for name in DATA if not (Path(place) / name).is_file()]
    if missing:
        text = f"{place}: without {', '.join(missing)}; see data/README.md"
        yield Finding("VDET_DATA", "absent", text)
    else:
        yield Finding("VDET_DATA", "ok", place)


LOOKS: tuple[Callable[[], Iterator[Finding]], ...] = (
    find_programs,
    find_machine,
    find_codecs,
    find_extras,
    find_models,
    find_data,
)


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _encode() -> None:
    """Encode one small frame."""
    context = av.codec.CodecContext.create("libx264", "w")
    assert isinstance(context, av.VideoCodecContext)
    context.width, context.height, context.pix_fmt = 64, 64, "yuv420p"
    context.time_base = Fraction(1, 25)
    frame = av.VideoFrame.from_ndarray(np.zeros((96, 64), np.uint8), format="yuv420p")
    frame.pts = 0
    if not [*context.encode(frame), *context.encode(None)]:
        raise ValueError("it gave nothing")


def _can_decode(name: str) -> bool:
    try:
        av.codec.Codec(name, "r")
    except ValueError:  # UnknownCodecError is one
        return False
    return True
