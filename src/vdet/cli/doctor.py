"""`vdet doctor`: whether everything that the program needs is there and works."""

import re
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from typing import Literal

from vdet.cli.command import command
from vdet.cli.results import Results, facts_options
from vdet.errors import in_one_line
from vdet.version import __version__

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

    Packages, cores, codecs, extras and the shipped models are checked. The exit code is 1 where
    something that vdet needs does not work.
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
    from vdet.workers import core_count

    yield Finding("vdet", "ok", f"{__version__}, on {core_count()} cores")
    for extra, packages in required_packages().items():
        missing = [package for package in packages if not installed_version(package)]
        text = ", ".join(f"{package} {installed_version(package)}" for package in packages)
        status: Literal["ok", "absent", "broken"] = "ok"
        if missing:
            status, text = "absent" if extra else "broken", f"pip install {' '.join(missing)}"
        yield Finding(f"extra {extra}" if extra else "packages", status, text)
    yield _find("codecs", _check_codecs)
    for name in ("default", "svm", "seed"):
        yield _find(f"settings {name}", lambda name=name: _load(name))  # type: ignore[misc]


def required_packages() -> dict[str, list[str]]:
    """Return the packages of each extra, and under "" those that vdet always needs."""
    found: dict[str, list[str]] = {}
    for text in requires("vdet") or ():
        package, extra = re.split(r"[^\w.-]", text)[0], re.search(r"extra == .(\w+)", text)
        found.setdefault(extra[1] if extra else "", []).append(package)
    found.pop("dev", None)
    return found


def installed_version(package: str) -> str | None:
    """Return the version of an installed package; None where there is none."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _find(name: str, check: Callable[[], str]) -> Finding:
    try:
        return Finding(name, "ok", check())
    except Exception as error:  # whatever it is, it does not work
        return Finding(name, "broken", f"{in_one_line(error)}; install vdet again")


def _check_codecs() -> str:
    import av

    av.Codec("libx264", "w")
    av.Codec("h264", "r")
    missing = sorted(set(DECODERS) - av.codecs_available)
    return "encodes and decodes h264" + (f"; missing: {', '.join(missing)}" if missing else "")


def _load(name: str) -> str:
    from vdet.config.loading import find_config, load_settings
    from vdet.detect.factory import load_detector

    path = find_config(name)
    load_detector(load_settings(path).detector)
    return f"{path}, its model loads"
