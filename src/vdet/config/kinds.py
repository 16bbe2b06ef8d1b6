"""Sections of which there are several kinds: the detectors and the trackers."""

from dataclasses import dataclass

from vdet.config.schema import (
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
    built_in: dict[str, type[Section]]

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


SECTIONS_WITH_KINDS = {
    "detector": SectionKinds("kind", DETECTORS, {"svm": SvmSettings, "net": NetworkSettings}),
    "tracker": SectionKinds(
        "method", TRACKERS, {"motion": MotionTrackerSettings, "rules": RulesTrackerSettings}
    ),
}
"""By the name of the section."""
