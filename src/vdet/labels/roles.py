"""The words of label files: which are vehicles, which are ignore regions."""

from enum import Enum

from vdet.detect.classes import WORDS, letters, our_name


class Role(Enum):
    """How a labelled box is scored."""

    VEHICLE = "a vehicle to be found"
    IGNORED = "an ignore region: a prediction in it is neither right nor wrong"
    OTHER = "not a vehicle: the box is skipped, and a prediction on it is wrong"


_REGIONS = ("ignore", "ignored", "ignore region", "ignored region", "ignored regions", "dont care")
_WORDS = {
    Role.VEHICLE: tuple(
        word for name in ("car", "truck", "bus", "vehicle") for word in WORDS[name]
    ),
    Role.IGNORED: (
        *_REGIONS,
        *("tram", "train", "misc", "trailer", "caravan", "auto-rickshaw", *WORDS["motorcycle"]),
    ),
    Role.OTHER: ("pedestrian", "person", "person sitting", "cyclist", "bicycle", "rider"),
}
_REGION_LETTERS = {letters(word) for word in _REGIONS}
_ROLES = {letters(word): role for role, words in _WORDS.items() for word in words}


def role_of(label: str) -> Role:
    """Return the role of a label of a video; case, spaces and punctuation do not matter.

    Raises
    ------
    ValueError
        The label is not one of the known words.
    """
    role = _ROLES.get(letters(label))
    if role is None:
        known = "; ".join(", ".join(words) for words in _WORDS.values())
        raise ValueError(f"label {label!r:.40} is unknown; use one of: {known}")
    return role


def is_region(label: str | None) -> bool:
    """Return whether a label says that its box is a region, and no single thing."""
    return label is not None and letters(label) in _REGION_LETTERS


def class_of(label: str) -> tuple[str, bool] | None:
    """Return what a label of a picture means: one of `OUR_NAMES`, and whether it is ignored.

    An ignore region is a "vehicle". None where the label means neither, or is unknown: sets of
    pictures name all kinds of things.
    """
    name = our_name(label)
    if name is not None:
        return name, False
    return ("vehicle", True) if _ROLES.get(letters(label)) is Role.IGNORED else None
