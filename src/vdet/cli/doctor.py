"""`vdet doctor`: whether everything that the program needs is there and works."""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from fractions import Fraction
from importlib.metadata import PackageNotFoundError, version
from typing import Literal

from vdet.cli.command import command
from vdet.cli.results import Results, facts_options
from vdet.errors import in_one_line
from vdet.version import __version__

NEEDED = (
    *("av", "click", "Jinja2", "joblib", "loky", "numpy", "onnxruntime", "opencv-python-headless"),
    *("pillow", "pydantic", "PyYAML", "scikit-learn", "scipy", "threadpoolctl", "tqdm"),
)
EXTRAS = {
    "dask": ("dask", "distributed"),
    "train": ("onnx", "torch"),
}
"""The packages of each extra, as `pyproject.toml` has them."""

DECODERS = ("h264", "hevc", "av1", "vp9", "mpeg4", "mjpeg")


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at: "absent" where vdet works without it, "broken" where not."""

    name: str
    status: Literal["ok", "absent", "broken"]
    text: str


@command("vdet doctor", "vdet doctor --json -")
@facts_options
def doctor(results: Results) -> int:
    """Check whether vdet works on this machine.

    Versions, cores, the encoder, decoders, extras and the shipped models are checked. The exit code
    is 1 where something that vdet needs does not work.
    """
    results.check()
    findings = list(find_all())
    works = all(finding.status != "broken" for finding in findings)
    lines = [f"{each.status:6}  {each.name}: {each.text}" for each in findings]
    lines.append("vdet works here" if works else "vdet does not work here: see what is broken")
    results.print(lines, {"works": works, "findings": [asdict(finding) for finding in findings]})
    return 0 if works else 1


def find_all() -> Iterator[Finding]:
    """Look at everything, one after the other."""
    yield Finding("vdet", "ok", __version__)
    for what, check in {
        "packages": _check_packages,
        "cores": _count_cores,
        "encoder": _check_encoder,
        "decoders": _check_decoders,
    }.items():
        yield _find(what, check)
    for extra, packages in EXTRAS.items():
        missing = [package for package in packages if not _version(package)]
        text = f"pip install {' '.join(missing)}" if missing else ", ".join(packages)
        yield Finding(f"extra {extra}", "absent" if missing else "ok", text)
    for name in ("default", "svm", "seed"):
        yield _find(f"settings {name}", lambda name=name: _load(name))  # type: ignore[misc]


def _find(name: str, check: Callable[[], str]) -> Finding:
    try:
        return Finding(name, "ok", check())
    except Exception as error:  # whatever it is, it does not work
        return Finding(name, "broken", f"{in_one_line(error)}; install vdet again")


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _check_packages() -> str:
    import cv2

    if missing := [package for package in NEEDED if not _version(package)]:
        raise ImportError(f"not installed: {', '.join(missing)}")
    _ = cv2.HOGDescriptor  # OpenCV 5 has none
    return ", ".join(f"{package} {_version(package)}" for package in NEEDED)


def _count_cores() -> str:
    from vdet.workers import core_count

    return str(core_count())


def _check_encoder() -> str:
    """Encode one small frame."""
    import av

    context = av.VideoCodecContext.create("libx264", "w")
    context.width, context.height, context.pix_fmt = 64, 64, "yuv420p"
    context.framerate = Fraction(25)
    frame = av.VideoFrame(64, 64, "yuv420p")
    frame.pts = 0
    if not [*context.encode(frame), *context.encode(None)]:
        raise ValueError("libx264 gave nothing")
    return "libx264 writes video"


def _check_decoders() -> str:
    import av

    missing = sorted(set(DECODERS) - av.codecs_available)
    if "h264" in missing:
        raise ImportError("h264 is missing")
    return ", ".join(DECODERS) + (f"; missing: {', '.join(missing)}" if missing else "")


def _load(name: str) -> str:
    from vdet.config.loading import find_config, load_settings
    from vdet.detect.factory import load_detector

    path = find_config(name)
    load_detector(load_settings(path).detector)
    return f"{path}, its model loads"
