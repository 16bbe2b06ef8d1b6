"""The role of a labelled box in evaluation and training: vehicle, ignore region, or neither."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from vdet.config.schema import Role, Settings
from vdet.detect.classes import OUR_NAMES, WORDS, letters, our_name

RIDER = "rider"
"""A person on a motorcycle or a bicycle, labelled apart from what is ridden."""

_IGNORED = ("tram", "train", "misc", "trailer", "caravan", RIDER)
_REGIONS = ("ignore", "ignored", "ignore region", "ignored region", "ignored regions", "dont care")
_REGION_LETTERS = tuple(dict.fromkeys(map(letters, _REGIONS)))
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
    classes
        The class that the letters of each class mean.
    """

    words: Mapping[str, Role]
    classes: Mapping[str, str]

    @classmethod
    def of(cls, roles: Mapping[str, Role], classes: Sequence[str]) -> Self:
        """Return the roles of words; a class without a role is a vehicle if it is in `classes`.

        Other known classes are ignored. A class of `classes` whose role is "other" is ignored too:
        the detector finds it, so it is not a part of the background.
        """
        words: dict[str, Role] = dict.fromkeys((*OUR_NAMES, *map(_key, _IGNORED)), "ignored")
        words.update(dict.fromkeys(map(_key, classes), "vehicle"))
        for word, role in roles.items():
            is_found = words.get(_key(word)) == "vehicle"
            words[_key(word)] = "ignored" if is_found and role == "other" else role
        words.update(dict.fromkeys(_REGION_LETTERS, "ignored"))
        return cls(words, {_key(name): name for name in classes})

    @classmethod
    def from_settings(cls, settings: Settings) -> Self:
        """Return the roles of `labels.roles`, and of the classes that the detector finds.

        "vehicle" among these includes cars, trucks and buses.
        """
        classes = settings.detector.vehicle_classes
        any_kind = _ANY_KIND if "vehicle" in classes else ()
        return cls.of(settings.labels.roles, (*classes, *any_kind))

    @classmethod
    def for_training(cls, settings: Settings) -> Self:
        """Return the roles of `labels.roles`, and of the classes that a network learns.

        A vehicle of unknown kind is learnt if the network learns cars, trucks or buses.
        """
        classes = settings.train.net.classes
        unknown = () if set(_ANY_KIND).isdisjoint(classes) else ("vehicle",)
        return cls.of(settings.labels.roles, (*classes, *unknown))

    def role_of(self, label: str) -> Role | None:
        """Return the role of a label; None if it is unknown."""
        return self.words.get(_key(label))

    def class_of(self, label: str) -> str | None:
        """Return the class that a label means; None if it means none."""
        return our_name(label) or self.classes.get(letters(label))

    @property
    def known(self) -> str:
        """All known words, for messages."""
        return ", ".join(", ".join(WORDS.get(word, (word,))) for word in self.words)


DEFAULT_ROLES = Roles.from_settings(Settings())
"""The roles of the default settings."""


def is_region(label: str | None) -> bool:
    """Return whether a label marks a region, not a single object."""
    return label is not None and letters(label) in _REGION_LETTERS
