"""Sections of which there are several kinds: the detectors and the trackers."""

from pathlib import Path

from vdet.config.schema import DetectorSettings, MotionTrackerSettings, NetworkSettings, SvmSettings
from vdet.config.section import Section
from vdet.config.tracker import RulesTrackerSettings
from vdet.errors import ConfigError
from vdet.plugins import DETECTORS, TRACKERS, load_plugin, plugin_names

GROUPS = {"detector": DETECTORS, "tracker": TRACKERS}
"""The sections with kinds, and the groups of entry points in which other packages register theirs.

The key `kind` of such a section names its kind.
"""

_DETECTORS: dict[str, type[DetectorSettings]] = {"svm": SvmSettings, "net": NetworkSettings}
_TRACKERS: dict[str, type[Section]] = {
    "motion": MotionTrackerSettings,
    "rules": RulesTrackerSettings,
}


def kind_names(section: str) -> list[str]:
    """Return the names of all kinds of a section, those of vdet first."""
    return plugin_names(GROUPS[section])


def kind_settings(section: str, name: str) -> type[Section]:
    """Return the class of the settings of a kind.

    Raises
    ------
    ConfigError
        There is no such kind, it cannot be loaded, or it has no settings of this name.
    """
    if own := (_DETECTORS if section == "detector" else _TRACKERS).get(name):
        return own
    settings = getattr(load_plugin(GROUPS[section], name), "settings", None)
    if isinstance(settings, type) and issubclass(settings, Section) and kind_of(settings) == name:
        return settings
    raise ConfigError(
        f'{name}: its settings are no section with kind = "{name}"; repair or reinstall that '
        "package"
    )


def kind_of(settings: type[Section]) -> object:
    """Return the kind that a class of settings is for; None for one without kinds."""
    field = settings.model_fields.get("kind")
    return field and field.default


def kind_of_model(path: Path) -> str | None:
    """Return the kind of detector that a model file is for; None where its ending does not say."""
    suffix = path.suffix.lower()
    return next((kind for kind, each in _DETECTORS.items() if each.model_suffix == suffix), None)
