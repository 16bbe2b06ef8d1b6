"""The section `labels`: what the labels of files mean."""

from typing import Literal

from pydantic import Field, field_validator

from vdet.config.section import Section

Role = Literal["vehicle", "ignored", "other"]
"""What a labelled box is in evaluation and training."""

_WORDS: dict[Role, tuple[str, ...]] = {
    "ignored": ("tram", "train", "misc", "trailer", "caravan", "auto-rickshaw"),
    "other": ("pedestrian", "person", "person sitting", "cyclist", "bicycle", "rider"),
}
_ROLES = {word: role for role, words in _WORDS.items() for word in words}


class LabelSettings(Section):
    """What the labels of videos and pictures mean."""

    roles: dict[str, Role] = Field(_ROLES, max_length=1000)
    """vehicle: must be found. ignored: detections there are not judged. other: left out. Without a
    role, car, truck, bus, motorcycle and vehicle are vehicles if the detector looks for them, and
    ignored if not.
    """

    @field_validator("roles")
    @classmethod
    def _add_defaults(cls, roles: dict[str, Role]) -> dict[str, Role]:
        return _ROLES | roles
