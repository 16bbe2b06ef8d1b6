"""The role of a labelled box in evaluation and training: vehicle, ignore region, or neither."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from vdet.config.schema import Role, Settings
from vdet.detect.classes import OUR_NAMES, WORDS, letters, our_name

_REGIONS = ("ignore", "ignored", "ignore region", "ignored region", "ignored regions", "dont care")
_REGION_LETTERS = {letters(word) for word in _REGIONS}
_ANY_KIND = ("car", "truck", "bus")  # what "vehicle" among the classes of a detector includes


def _key(word: str) -> str:
    """Return the class that a word means, else its letters."""
    return our_name(word) or letters(word)


@dataclass(frozen=True, slots=True)
class Roles:
    """The meaning of labels; case, spaces and punctuation do not matter.

    Attributes
    ----------
    words
        The role of each known word.
    """

    words: Mapping[str, Role]

    @classmethod
    def of(cls, roles: Mapping[str, Role], classes: Sequence[str]) -> Self:
        """Return the roles of words; a class without a role is a vehicle if it is in `classes`.

        The other classes of vehicles are ignored. "vehicle" in `classes` includes cars, trucks and
        buses.
        """
        words: dict[str, Role] = dict.fromkeys(OUR_NAMES, "ignored")
        found = (*classes, *(_ANY_KIND if "vehicle" in classes else ()))
        words.update(dict.fromkeys(map(_key, found), "vehicle"))
        words.update({_key(word): role for word, role in roles.items()})
        words.update(dict.fromkeys(_REGION_LETTERS, "ignored"))
        return cls(words)

    @classmethod
    def from_settings(cls, settings: Settings) -> Self:
        """Return the roles of `labels.roles`, and of the classes that the detector finds."""
        return cls.of(settings.labels.roles, settings.detector.vehicle_classes)

    def role_of(self, label: str) -> Role | None:
        """Return the role of a label; None if it is unknown."""
        return self.words.get(_key(label))

    @property
    def known(self) -> str:
        """All known words, for messages."""
        return ", ".join(", ".join(WORDS.get(word, (word,))) for word in self.words)


DEFAULT_ROLES = Roles.from_settings(Settings())
"""The roles of the default settings."""


def is_region(label: str | None) -> bool:
    """Return whether a label marks a region, not a single object."""
    return label is not None and letters(label) in _REGION_LETTERS
