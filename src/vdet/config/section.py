"""The base class of all sections of the settings."""

import logging
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

FRAME_LENGTH = "pixels of a frame of `REFERENCE_HEIGHT` rows"
"""Marks a length that `scale_lengths` scales."""
REFERENCE_HEIGHT = 720
"""Rows of the frames that lengths in frame pixels are given for."""
Pixels = Annotated[int, Field(ge=0, le=100_000), FRAME_LENGTH]
Ratio = Annotated[float, Field(ge=0, le=1)]


class Section(BaseModel):
    """A part of the settings: immutable; unknown keys and NaN are rejected.

    `renamed` has the new names of keys whose old names are still read.
    """

    renamed: ClassVar[Mapping[str, str]] = {}

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    @classmethod
    def keys(cls) -> tuple[str, ...]:
        """Return the keys as users write them."""
        return tuple(field.alias or name for name, field in cls.model_fields.items())

    @model_validator(mode="before")
    @classmethod
    def _mark_unknown(cls, values: Any) -> Any:
        """Replace the values of unknown keys by this class, so that errors can name its keys.

        A section without keys is null in YAML, and stands for the defaults.
        """
        if not isinstance(values, dict | None):
            return values
        marked: dict[str, Any] = {}
        known = cls.keys()
        for key, value in (values or {}).items():
            if new_name := cls.renamed.get(key):
                logging.getLogger(__name__).warning("%s: is deprecated; use %s", key, new_name)
            marked[new_name or key] = value if (new_name or key) in known else cls
        return marked


S = TypeVar("S", bound=Section)


def scale_lengths(section: S, factor: float) -> S:
    """Multiply every length in frame pixels, in a section and the sections in it, by `factor`.

    Products are rounded to whole pixels, halves up; fractions and counts are not changed.
    """
    if factor == 1:
        return section
    scaled: dict[str, Any] = {}
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if FRAME_LENGTH in field.metadata:
            scaled[name] = int(value * factor + 0.5)
        elif isinstance(value, Section):
            scaled[name] = scale_lengths(value, factor)
        elif isinstance(value, tuple) and value and isinstance(value[0], Section):
            scaled[name] = tuple(scale_lengths(item, factor) for item in value)
    return section.model_copy(update=scaled)
