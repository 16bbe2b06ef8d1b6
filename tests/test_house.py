"""The house rules that a machine can check: who imports whom, how quick to start."""

import ast
import graphlib
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "vdet"
MODULES = sorted(PACKAGE.rglob("*.py"))

ROOMS = (
    "__main__", "cli", "demo", "testing", "api", "batch", "learn", "evaluate", "run",
    "review", "pages", "conditions", "traffic", "labels", "lanes", "track", "detect", "synthetic",
    "draw", "regions", "media", "config", "plugins", "workers", "files", "polygons", "boxes",
    "findings", "errors", "__init__", "version",
)  # fmt: skip
"""From top to bottom: a room imports only what stands below it."""

RE_EXPORT = ("__init__", "api")
"""`import vdet` gives the names of the API, loaded when they are first used."""

TEXTS = sorted(
    path
    for pattern in (
        *("src/**/*", "tests/**/*", "configs/*", "benchmarks/**/*"),
        *("docs/*", "data/README.md", "*"),
    )
    for path in ROOT.glob(pattern)
    if path.is_file()
    and path.suffix in {".py", ".md", ".yaml", ".toml", ".txt", ".json"}
    and not path.relative_to(ROOT).parts[0].startswith(".")
)
# Put together, so that this file does not name one itself.
LOCAL_PATH = re.compile(
    r"(?<![\w.*:/])/(?:" + "|".join(["work", "home", "Users", "root"]) + r")/\w"
)


def name_of(path: Path) -> str:
    """Return a module's dotted name without `vdet.`; packages as themselves."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if len(parts) > 1 and parts[-1] == "__init__" else parts)


NAMES = {name_of(path): path for path in MODULES}


def room_of(module: str) -> str:
    return module.split(".", maxsplit=1)[0]


def imports_of(path: Path) -> Iterator[str]:
    """Give the modules of vdet that a file imports, also inside functions."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (_without_vdet(alias.name) for alias in node.names if _of_vdet(alias.name))
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute here"
            if node.module and _of_vdet(node.module):
                yield from (_imported(node.module, alias.name) for alias in node.names)


def _of_vdet(module: str) -> bool:
    return module.split(".", maxsplit=1)[0] == "vdet"


def _without_vdet(module: str) -> str:
    return module.partition(".")[2] or "__init__"


def _imported(module: str, name: str) -> str:
    """Return what `from module import name` imports: a module of that name, or something in it."""
    inside = _without_vdet(f"{module}.{name}")
    return inside if inside in NAMES else _without_vdet(module)


def test_every_room_has_its_place() -> None:
    assert {room_of(name) for name in NAMES} <= set(ROOMS)
    assert len(set(ROOMS)) == len(ROOMS)


def test_a_module_imports_only_what_stands_below_its_room() -> None:
    upward = [
        f"{module} imports {used}"
        for module, path in NAMES.items()
        for used in imports_of(path)
        if ROOMS.index(room_of(used)) < ROOMS.index(room_of(module)) and (module, used) != RE_EXPORT
    ]
    assert upward == []


def test_no_modules_import_each_other_in_a_circle() -> None:
    graph = {name: set(imports_of(path)) - {name} for name, path in NAMES.items()}
    order = list(graphlib.TopologicalSorter(graph).static_order())  # CycleError names the circle
    assert len(order) == len(NAMES)


HEAVY = {"av", "cv2", "joblib", "numpy", "onnxruntime", "scipy", "sklearn", "torch"}
STARTS = {
    "help": "main(['--help'])",
    "version": "main(['--version'])",
    "help of a command": "main(['detect-video', '--help'])",
    "config": "main(['config', '-c', 'seed'])",
    "a wrong option": "main(['eval', 'video', '--wrong'])",
    "wrong usage": "main(['detect-video', 'in.mp4', '--tracks', 'out.csv'])",
}


def loaded_by(code: str) -> set[str]:
    """Return the packages that a start of the program imports."""
    return {name.partition(".")[0] for name in modules_of(code)}


def modules_of(code: str) -> set[str]:
    """Return the names of all modules that a start of the program imports."""
    text = (
        "import sys, vdet.__main__; from vdet import cli; main = cli.main\n"
        f"{code}\n"
        "print('\\nloaded', *sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize("what", STARTS)
def test_the_command_line_imports_nothing_heavy(what: str) -> None:
    found = loaded_by(STARTS[what])
    assert "click" in found
    assert found & HEAVY == set()


def test_a_command_imports_only_what_it_uses() -> None:
    found = loaded_by("main(['detect-video', 'missing.mp4', 'out.mp4'])")
    assert "av" in found
    assert found & {"distributed", "jinja2", "pandas", "scipy", "sklearn", "torch"} == set()


def test_finding_vehicles_imports_few_modules(clip_path: Path, tmp_path: Path) -> None:
    """A module costs about half a millisecond at every start."""
    start = f"main(['detect-video', '-q', {str(clip_path)!r}, {str(tmp_path / 'out.mp4')!r}])"
    assert 400 < len(modules_of(start)) < 600


def test_an_image_needs_no_traffic(tmp_path: Path) -> None:
    image, out = tmp_path / "road.png", tmp_path / "out.png"
    cv2.imwrite(str(image), np.full((360, 640, 3), 90, np.uint8))
    modules = modules_of(f"main(['detect-image', '-q', {str(image)!r}, '-o', {str(out)!r}])")
    assert out.exists()
    assert [name for name in modules if name.startswith("vdet.traffic")] == []


def test_no_two_classes_share_a_name() -> None:
    classes = re.compile(r"^ *class _*(\w+)", re.MULTILINE)
    names = Counter(name for path in MODULES for name in classes.findall(path.read_text("utf-8")))
    assert [name for name, number in names.items() if number > 1] == []


def test_what_is_printed_goes_through_one_function() -> None:
    """`print_lines` escapes the names in it."""
    printing = [name for name, path in NAMES.items() if "click.echo(" in path.read_text("utf-8")]
    assert printing == ["cli.command"]


def test_cores_are_counted_in_one_place() -> None:
    """Other functions do not know how many a control group allows."""
    asks = re.compile("cpu_count|sched_getaffinity")
    counting = [name for name, path in NAMES.items() if asks.search(path.read_text("utf-8"))]
    assert counting == ["workers"]


def test_no_text_names_a_place_on_somebodys_machine() -> None:
    assert len(TEXTS) > 100
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in TEXTS
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if LOCAL_PATH.search(line)
    ]
    assert found == []


def test_no_module_gives_one_name_two_values() -> None:
    """Where two modules are merged, the constant of one would silently replace the other's."""
    named = re.compile(r"^([A-Z_][A-Z0-9_]*(?:, [A-Z_][A-Z0-9_]*)*) = ", re.MULTILINE)
    twice = [
        f"{module}: {name}"
        for module, path in NAMES.items()
        for name, number in Counter(
            name for line in named.findall(path.read_text("utf-8")) for name in line.split(", ")
        ).items()
        if number > 1
    ]
    assert twice == []
