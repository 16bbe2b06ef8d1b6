"""The kinds of detectors and trackers, and the settings of each."""

from pathlib import Path
from typing import Any

from vdet.config.detector import NetworkSettings, SvmSettings
from vdet.config.section import Section
from vdet.config.tracker import MotionTrackerSettings, RulesTrackerSettings
from vdet.errors import ConfigError
from vdet.plugins import DETECTORS, TRACKERS, load_plugin

GROUPS = {"detector": DETECTORS, "tracker": TRACKERS}
"""The sections with kinds, and the groups of entry points in which other packages register theirs.

The key `kind` of such a section names its kind.
"""
_BUILT_IN: dict[str, dict[str, type[Section]]] = {
    "detector": {"net": NetworkSettings, "svm": SvmSettings},
    "tracker": {"motion": MotionTrackerSettings, "rules": RulesTrackerSettings},
}


def default_kind(section: str) -> str:
    """Return the kind of a section for which none is chosen."""
    return next(iter(_BUILT_IN[section]))


def kind_settings(section: str, name: str) -> type[Section]:
    """Return the class of the settings of a kind.

    Raises
    ------
    ConfigError
        There is no such kind, it cannot be loaded, or it has no settings of this name.
    """
    if own := _BUILT_IN[section].get(name):
        return own
    settings = getattr(load_plugin(GROUPS[section], name), "settings", None)
    if isinstance(settings, type) and issubclass(settings, Section):
        kind = settings.model_fields.get("kind")
        if kind and kind.default == name:
            return settings
    raise ConfigError(f'{name}: has no settings of kind = "{name}"; repair that package')


def with_kind(section: str, values: Any) -> Any:
    """Validate the values of a section as the settings of their kind."""
    if values is not None and not isinstance(values, dict):
        return values
    kind = (values or {}).get("kind", default_kind(section))
    return kind_settings(section, str(kind)).model_validate(values)


def kind_of_model(path: Path) -> str | None:
    """Return the kind of detector that a model file is for; None if its suffix does not tell."""
    kinds = {SvmSettings.model_suffix: "svm", NetworkSettings.model_suffix: "net"}
    return kinds.get(path.suffix.lower())
