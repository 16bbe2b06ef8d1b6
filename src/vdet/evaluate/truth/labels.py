"""What a label's word means for the scores."""

from enum import Enum


class Role(Enum):
    """How a labelled box is treated."""

    VEHICLE = "a vehicle to be found"
    IGNORED = "an ignore region: a prediction in it is neither right nor wrong"
    OTHER = "not a vehicle: the box is passed over, and a prediction on it is wrong"


_WORDS = {
    Role.VEHICLE: ("car", "van", "truck", "lorry", "bus", "pickup", "suv", "taxi", "vehicle"),
    Role.IGNORED: (
        *("ignore", "ignored", "ignore region", "dont care"),
        *("tram", "misc", "motorcycle", "motorbike", "trailer"),
    ),
    Role.OTHER: ("pedestrian", "person", "person sitting", "cyclist", "bicycle", "rider"),
}


def _plain(label: str) -> str:
    return "".join(letter for letter in label.casefold() if letter.isalpha())


_ROLES = {_plain(word): role for role, words in _WORDS.items() for word in words}


def role_of(label: str) -> Role:
    """Return the role of a label; case, spaces and punctuation do not count.

    Raises
    ------
    ValueError
        The label is not one of the known words.
    """
    role = _ROLES.get(_plain(label))
    if role is None:
        known = "; ".join(", ".join(words) for words in _WORDS.values())
        raise ValueError(f"label {label!r:.40} is unknown; use one of: {known}")
    return role
