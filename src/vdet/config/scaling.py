"""Lengths in the settings, fitted to the frame that is searched."""

from typing import Any, TypeVar

from vdet.config.schema import FRAME_LENGTH, Section

S = TypeVar("S", bound=Section)


def scale_lengths(section: S, factor: float) -> S:
    """Multiply every frame length of `section` and of the sections in it by `factor`.

    Products are rounded to whole pixels, halves up; fractions and counts stay as they are.
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
