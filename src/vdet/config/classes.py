"""Classes of vehicles: their names in all outputs, and their synonyms."""

import re
from collections.abc import Collection, Iterable
from functools import lru_cache

OUR_NAMES = ("car", "truck", "bus", "motorcycle", "bicycle", "person", "vehicle")
"""The classes in all outputs; `vehicle` is a vehicle of unknown class."""

UNKNOWN = "vehicle"
"""Name of a vehicle of unknown class, also for formats that need a name."""

WORDS = {
    "car": ("car", "van", "suv", "taxi", "pickup", "pickup truck"),
    "truck": ("truck", "lorry"),
    "bus": ("bus", "coach"),
    "motorcycle": ("motorcycle", "motorbike", "motor", "motorcyclist", "scooter"),
    "bicycle": ("bicycle", "bike", "cyclist"),
    "person": ("person", "pedestrian", "person sitting"),
    "vehicle": ("vehicle", "other vehicle", "rickshaw", "auto-rickshaw", "tuk-tuk", "tempo"),
}
"""Synonyms of `OUR_NAMES` in label files and networks."""


def is_chosen(class_name: str | None, chosen: Collection[str]) -> bool:
    """Return whether a vehicle is of one of the chosen classes; empty means all."""
    return not chosen or (class_name or UNKNOWN) in chosen


def in_file_name(class_name: str | None) -> str:
    """Return a class for use in a file name."""
    return re.sub(r"[^\w-]+", "-", class_name or UNKNOWN)


@lru_cache(maxsize=1000)
def letters(label: str) -> str:
    """Return the letters of a label: case, spaces and punctuation do not matter."""
    return "".join(letter for letter in label.casefold() if letter.isalpha())


_NAMES = {letters(word): name for name, words in WORDS.items() for word in words}


@lru_cache(maxsize=1000)
def our_name(label: str) -> str | None:
    """Return which of `OUR_NAMES` a label means; None if none."""
    return _NAMES.get(letters(label))


def our_names(labels: Iterable[str]) -> tuple[str, ...]:
    """Return what each label means, once: one of `OUR_NAMES`, or the label in lower case."""
    return tuple(dict.fromkeys(our_name(label) or label.strip().lower() for label in labels))
