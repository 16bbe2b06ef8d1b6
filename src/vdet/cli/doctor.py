"""`vdet doctor`: whether everything that the program needs is there and works."""

import re
from collections.abc import Callable, Iterator
from functools import partial

from vdet.cli.command import command
from vdet.cli.results import Results, facts_options
from vdet.errors import in_one_line, opencv_fault
from vdet.version import __version__

Finding = tuple[str, str, str]
"""What was checked, "ok", "absent" (vdet works without it) or "broken", and what was found."""


@command("vdet doctor", "vdet doctor --json -")
@facts_options
def doctor(results: Results) -> int:
    """Check whether vdet works on this machine.

    Packages, codecs and the shipped models are checked. The exit code is 1 if something that vdet
    needs does not work.
    """
    results.check()
    from vdet.config.loading import shipped_configs
    from vdet.workers import core_count

    found = [("vdet", "ok", f"{__version__}, on {core_count()} cores"), *_packages(), _opencv()]
    checks = {f"settings {name}": partial(_check_config, name) for name in shipped_configs()}
    found += [_checked(*item) for item in ({"codec h264": _check_codec} | checks).items()]
    works = all(status != "broken" for _, status, _ in found)
    lines = [f"{status:6}  {name}: {text}" for name, status, text in found]
    lines.append("vdet works here" if works else "vdet does not work here: see what is broken")
    findings = [{"name": name, "status": status, "text": text} for name, status, text in found]
    results.print(lines, {"works": works, "findings": findings})
    return 0 if works else 1


def _packages() -> Iterator[Finding]:
    """Check the packages that vdet needs, and those of each extra."""
    from importlib.metadata import PackageNotFoundError, requires, version

    for requirement in requires("vdet") or ():
        package = re.split(r"[^\w.-]", requirement)[0]
        extra = re.search(r"extra == .(\w+)", requirement)
        if extra and extra[1] == "dev":
            continue
        name = f"{package} (extra {extra[1]})" if extra else package
        try:
            yield name, "ok", version(package)
        except PackageNotFoundError:
            yield name, "absent" if extra else "broken", f"pip install {package}"


def _opencv() -> Finding:
    """Check the OpenCV that is imported: another package may have written over it."""
    if fault := opencv_fault():
        return "cv2", "broken", fault
    import cv2

    return "cv2", "ok", cv2.__version__


def _checked(name: str, check: Callable[[], str]) -> Finding:
    try:
        return name, "ok", check()
    except Exception as error:  # whatever it is, it does not work
        return name, "broken", f"{in_one_line(error)}; install vdet again"


def _check_codec() -> str:
    import av

    av.Codec("libx264", "w")
    av.Codec("h264", "r")
    return "can be written and read"


def _check_config(name: str) -> str:
    from vdet.config.loading import find_config, load_settings
    from vdet.detect.factory import load_detector

    path = find_config(name)
    load_detector(load_settings([path]).detector)
    return f"{path}, its model loads"
