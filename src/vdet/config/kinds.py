"""The kinds of detectors and trackers: what each is called, its settings, and who implements it.

The built-in kinds are here, so that reading settings imports no detector. `vdet.plugins` knows them
by name, together with those of other packages.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from vdet.config.detector import DetectorSettings, NetworkSettings, SvmSettings
from vdet.config.tracker import MotionTrackerSettings, RulesTrackerSettings, TrackerSettings
from vdet.errors import ConfigError
from vdet.plugins import DETECTORS, TRACKERS, built_in_names, load_plugin

GROUPS = {"detector": DETECTORS, "tracker": TRACKERS}
"""The sections with kinds, and the groups of entry points in which other packages register theirs.

The key `kind` of such a section names its kind.
"""


@dataclass(frozen=True, slots=True)
class DetectorKind:
    """A kind of detector, as registered under its name.

    Attributes
    ----------
    settings
        Class of the section `detector` for this kind; the default of its `kind` is the name.
    load
        Loads the detector, a `DetectorModel`, from its settings and a model file, None for the
        shipped one.
    shipped
        Returns the shipped model file for given settings; None if the kind needs no file.
    model_suffix
        Suffix of its model files, which selects this kind; only for kinds of vdet itself.
    tracker
        Defaults of the section `tracker` that differ for this kind.
    """

    settings: type[DetectorSettings]
    load: Callable[[Any, Path | None], Any]
    shipped: Callable[[Any], Path | None] = lambda _: None
    model_suffix: str | None = None
    tracker: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TrackerKind:
    """A kind of tracker, as registered under its name.

    Attributes
    ----------
    settings
        Class of the section `tracker` for this kind; the default of its `kind` is the name.
    make
        Makes a `VideoTracker` from these settings and the width and height of the frames, pixels.
    """

    settings: type[TrackerSettings]
    make: Callable[[Any, int, int], Any]


def _imported(name: str) -> Callable[..., Any]:
    """Return a function that imports another function when it is called, and calls it."""

    def call(*args: Any) -> Any:
        return resolve_name(name)(*args)

    return call


NET = DetectorKind(
    NetworkSettings,
    load=_imported("vdet.detect.onnx.detector:NetworkModel"),
    shipped=_imported("vdet.detect.onnx.detector:shipped_network"),
    model_suffix=".onnx",
)
SVM = DetectorKind(
    SvmSettings,
    load=_imported("vdet.detect.svm.detector:load_svm"),
    shipped=_imported("vdet.detect.svm.detector:shipped_model"),
    model_suffix=".npz",
    tracker={"look_ahead": 0.8},
)
MOTION = TrackerKind(MotionTrackerSettings, _imported("vdet.track.motion.tracker:MotionTracker"))
RULES = TrackerKind(RulesTrackerSettings, _imported("vdet.track.rules.tracker:make_rules_tracker"))


def default_kind(section: str) -> str:
    """Return the kind of a section for which none is chosen."""
    return built_in_names(GROUPS[section])[0]


def with_kind(section: str, values: Any) -> Any:
    """Validate the values of a section as the settings of their kind."""
    if values is not None and not isinstance(values, dict):
        return values
    kind = (values or {}).get("kind", default_kind(section))
    return load_plugin(GROUPS[section], str(kind)).settings.model_validate(values)


def tracker_defaults(detector: Any) -> dict[str, Any]:
    """Return the `DetectorKind.tracker` of a kind of detector, which may be unknown."""
    with suppress(ConfigError):
        return dict(load_plugin(DETECTORS, str(detector)).tracker)
    return {}


def kind_of_model(path: Path) -> str | None:
    """Return the kind of detector that a model file is for; None if its suffix does not tell."""
    kinds = {load_plugin(DETECTORS, name).model_suffix: name for name in built_in_names(DETECTORS)}
    return kinds.get(path.suffix.lower())
