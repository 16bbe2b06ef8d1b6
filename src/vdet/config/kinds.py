"""Sections of which there are several kinds: the detectors and the trackers."""

from vdet.config.schema import MotionTrackerSettings, RulesTrackerSettings, Section, SvmSettings
from vdet.plugins import DETECTORS, TRACKERS, load_plugin, plugin_names

Kinds = dict[str, type[Section]]
"""The section's class that was chosen, by the section's name."""

UNIONS = {"detector": "kind", "tracker": "method"}
"""The key by which each such section chooses its kind."""

_GROUPS = {"detector": DETECTORS, "tracker": TRACKERS}
_OWN: dict[str, dict[str, type[Section]]] = {
    "detector": {"svm": SvmSettings},
    "tracker": {"motion": MotionTrackerSettings, "rules": RulesTrackerSettings},
}


def kind_names(section: str) -> list[str]:
    """Return the names of all kinds of a section."""
    return plugin_names(_GROUPS[section])


def section_of_kind(section: str, name: str) -> type[Section]:
    """Return the settings' class of a kind. Raises `ConfigError` where there is no such kind."""
    if name in _OWN[section]:
        return _OWN[section][name]
    settings: type[Section] = load_plugin(_GROUPS[section], name).settings
    return settings
