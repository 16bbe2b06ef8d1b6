"""Classes of vehicles: their names in all outputs, and their synonyms."""

import re
from collections.abc import Collection, Iterable
from functools import lru_cache

STANDARD_CLASSES = ("car", "truck", "bus", "motorcycle", "bicycle", "person", "vehicle")
"""The classes in all outputs; `vehicle` is a vehicle of unknown class."""

UNKNOWN = "vehicle"
"""Name of a vehicle of unknown class, also for formats that need a name."""

WORDS = {
    "car": (
        *("car", "van", "suv", "taxi", "pickup", "pickup truck", "jeep", "ambulance"),
        *("LGV", "light goods vehicle"),
    ),
    "truck": ("truck", "lorry", "HGV", "heavy goods vehicle"),
    "bus": ("bus", "coach", "minibus"),
    "motorcycle": ("motorcycle", "motorbike", "motor", "motorcyclist", "scooter", "two-wheeler"),
    "bicycle": ("bicycle", "bike", "cyclist"),
    "person": ("person", "pedestrian", "person sitting"),
    "vehicle": (
        *("vehicle", "other vehicle", "rickshaw", "auto-rickshaw", "auto", "e-rickshaw"),
        *("tuk-tuk", "tempo", "tricycle", "awning-tricycle"),
    ),
}
"""Synonyms of `STANDARD_CLASSES` in label files and networks."""


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
def standard_class(label: str) -> str | None:
    """Return which of `STANDARD_CLASSES` a label means; None if none."""
    return _NAMES.get(letters(label))


def standard_classes(labels: Iterable[str]) -> tuple[str, ...]:
    """Return what each label means, once: one of `STANDARD_CLASSES`, or the label in lower case."""
    return tuple(dict.fromkeys(standard_class(label) or label.strip().lower() for label in labels))
