"""The role of a labelled box in evaluation and training: vehicle, ignore region, or neither."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from vdet.config.classes import STANDARD_CLASSES, letters, standard_class
from vdet.config.schema import Role, Settings

_IGNORED = ("tram", "train", "misc", "trailer", "caravan", "rider")
_REGIONS = ("ignore", "ignored", "ignore region", "ignored region", "ignored regions", "dont care")
_REGION_LETTERS = tuple(dict.fromkeys(map(letters, _REGIONS)))
_ANY_KIND = ("car", "truck", "bus")  # included in the class "vehicle" of a detector


def _key(word: str) -> str:
    """Return the class of a word, else its letters."""
    return standard_class(word) or letters(word)


@dataclass(frozen=True, slots=True)
class Roles:
    """The meaning of labels; case, spaces and punctuation do not matter.

    Attributes
    ----------
    words
        The role of each known word.
    classes
        The class by the letters of its name.
    """

    words: Mapping[str, Role]
    classes: Mapping[str, str]

    @classmethod
    def of(cls, roles: Mapping[str, Role], classes: Sequence[str]) -> Self:
        """Return the roles of words; a class without a role is a vehicle if it is in `classes`.

        Other known classes are ignored. A class in `classes` with the role "other" is also ignored:
        the detector finds it, so it is not background.
        """
        words: dict[str, Role] = dict.fromkeys((*STANDARD_CLASSES, *map(_key, _IGNORED)), "ignored")
        words.update(dict.fromkeys(map(_key, classes), "vehicle"))
        for word, role in roles.items():
            is_detected = words.get(_key(word)) == "vehicle"
            words[_key(word)] = "ignored" if is_detected and role == "other" else role
        words.update(dict.fromkeys(_REGION_LETTERS, "ignored"))
        return cls(words, {letters(name): name for name in classes})

    @classmethod
    def from_settings(cls, settings: Settings) -> Self:
        """Return the roles by `labels.roles` and the classes of the detector.

        The class "vehicle" includes cars, trucks and buses.
        """
        classes = settings.detector.vehicle_classes
        any_kind = _ANY_KIND if "vehicle" in classes else ()
        return cls.of(settings.labels.roles, (*classes, *any_kind))

    @classmethod
    def for_training(cls, settings: Settings) -> Self:
        """Return the roles by `labels.roles` and the classes that a network learns.

        Vehicles of unknown kind are learnt if the network learns cars, trucks or buses.
        """
        classes = settings.train.net.classes
        any_kind = () if set(_ANY_KIND).isdisjoint(classes) else ("vehicle",)
        return cls.of(settings.labels.roles, (*classes, *any_kind))

    def role_of(self, label: str) -> Role | None:
        """Return the role of a label; None if it is unknown."""
        return self.words.get(_key(label))

    def class_of(self, label: str) -> str | None:
        """Return the class of a label; None if it has none."""
        return self.classes.get(letters(label)) or standard_class(label)


DEFAULT_ROLES = Roles.from_settings(Settings())
"""The roles of the default settings."""


def is_region(label: str | None) -> bool:
    """Return whether a label marks a region, not a single object."""
    return label is not None and letters(label) in _REGION_LETTERS
