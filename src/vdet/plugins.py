"""Plug-ins by name: detectors, trackers, steps, sinks, formats and commands.

Other packages register theirs as entry points of these groups. A package is imported only when one
of its names is used.
"""

from functools import lru_cache
from importlib.metadata import entry_points
from pkgutil import resolve_name
from typing import Any

from vdet.errors import ConfigError, printable

DETECTORS = "vdet.detectors"
TRACKERS = "vdet.trackers"
STEPS = "vdet.steps"
SINKS = "vdet.sinks"
FORMATS = "vdet.formats"
COMMANDS = "vdet.commands"

_BUILT_IN: dict[str, dict[str, str]] = {
    COMMANDS: {
        "calibrate": "vdet.cli.camera:calibrate",
        "config": "vdet.cli.info:config",
        "count": "vdet.cli.count:count",
        "demo": "vdet.cli.info:demo",
        "detect-image": "vdet.cli.detect:detect_image",
        "detect-video": "vdet.cli.detect:detect_video",
        "draw": "vdet.cli.camera:draw",
        "eval": "vdet.cli.evaluate:eval_group",
        "info": "vdet.cli.info:info",
        "mine": "vdet.cli.train:mine",
        "review": "vdet.cli.count:review",
        "train": "vdet.cli.train:train",
        "train-net": "vdet.cli.train:train_net",
    },
    DETECTORS: {"net": "vdet.config.kinds:NET", "svm": "vdet.config.kinds:SVM"},
    TRACKERS: {"motion": "vdet.config.kinds:MOTION", "rules": "vdet.config.kinds:RULES"},
    SINKS: {
        name: f"vdet.run.sinks.{module}:{name}"
        for module, names in {
            "drawn": ("video", "image"),
            "data": ("tracks", "json", "labels", "vehicles", "counts", "flows", "conditions"),
            "folders": ("stages", "crops", "clips", "page", "review"),
        }.items()
        for name in names
    },
    FORMATS: {
        "mot": "vdet.labels.lines:MOT",
        "csv": "vdet.labels.lines:CSV",
        "jsonl": "vdet.labels.lines:JSON_LINES",
        "coco": "vdet.labels.coco:COCO",
    },
}
"""The plug-ins of vdet itself: where each name is defined. The first of a group is the default."""


def built_in_names(group: str) -> list[str]:
    """Return the names in a group that belong to vdet."""
    return list(_BUILT_IN.get(group, {}))


def plugin_names(group: str) -> list[str]:
    """Return all names in a group, those of vdet first."""
    built_in = built_in_names(group)
    return built_in + sorted({point.name for point in entry_points(group=group)} - set(built_in))


@lru_cache(maxsize=1)
def plugin_packages() -> tuple[str, ...]:
    """Return the names and versions of other packages on whose plug-ins results may depend."""
    groups = DETECTORS, TRACKERS, STEPS, SINKS, FORMATS
    packages = [point.dist for group in groups for point in entry_points(group=group)]
    return tuple(sorted({f"{package.name} {package.version}" for package in packages if package}))


def load_plugin(group: str, name: str) -> Any:
    """Import the object registered under a name in a group.

    Raises
    ------
    ConfigError
        Nothing is registered under this name, or it cannot be imported.
    """
    if name in built_in_names(group):
        return resolve_name(_BUILT_IN[group][name])
    for point in entry_points(group=group, name=name):
        try:
            return point.load()
        except Exception as error:  # another package's code may raise anything
            raise ConfigError(
                f"{name}: {point.value} cannot be loaded ({type(error).__name__}: {error})"
            ) from error
    names = ", ".join(plugin_names(group)) or "none"
    noun = group.removeprefix("vdet.").removesuffix("s")
    raise ConfigError(f"{printable(name)}: unknown {noun}; known: {names}")
