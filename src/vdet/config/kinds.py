"""Sections of which there are several kinds: the detectors and the trackers."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from vdet.config.schema import (
    DetectorSettings,
    MotionTrackerSettings,
    NetworkSettings,
    RulesTrackerSettings,
    SvmSettings,
)
from vdet.config.section import Section
from vdet.errors import ConfigError
from vdet.plugins import DETECTORS, TRACKERS, load_plugin, plugin_names


@dataclass(frozen=True, slots=True)
class SectionKinds:
    """The kinds of one section.

    Attributes
    ----------
    key
        The key of the section that names the kind.
    group
        The group of entry points in which other packages register theirs.
    built_in
        The settings' classes of vdet's own kinds, by name.
    """

    key: str
    group: str
    built_in: Mapping[str, type[Section]]

    @property
    def names(self) -> list[str]:
        """All names, those of vdet first."""
        return plugin_names(self.group)

    def settings(self, name: str) -> type[Section]:
        """Return the settings' class of a kind.

        Raises
        ------
        ConfigError
            There is no such kind, it cannot be loaded, or it has no settings of this name.
        """
        if name in self.built_in:
            return self.built_in[name]
        settings = getattr(load_plugin(self.group, name), "settings", None)
        if (
            isinstance(settings, type)
            and issubclass(settings, Section)
            and self.key in settings.model_fields
            and settings.model_fields[self.key].default == name
        ):
            return settings
        raise ConfigError(
            f'{name}: its settings are no section with {self.key} = "{name}"; repair or reinstall '
            "that package"
        )


_DETECTORS: dict[str, type[DetectorSettings]] = {"svm": SvmSettings, "net": NetworkSettings}

SECTIONS_WITH_KINDS = {
    "detector": SectionKinds("kind", DETECTORS, _DETECTORS),
    "tracker": SectionKinds(
        "kind", TRACKERS, {"motion": MotionTrackerSettings, "rules": RulesTrackerSettings}
    ),
}
"""By the name of the section."""


def kind_of_model(path: Path) -> str | None:
    """Return the kind of detector that a model file is for; None where its ending does not say."""
    suffix = path.suffix.lower()
    return next((kind for kind, each in _DETECTORS.items() if each.model_suffix == suffix), None)
