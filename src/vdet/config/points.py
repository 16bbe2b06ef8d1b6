"""Points in plain settings: from pixels of `camera.size` to fractions of the frame, and back."""

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import TypeAdapter, ValidationError

from vdet.config.camera import Size

_POINTS = {
    ("regions",): {"points"},
    ("traffic", "lines"): {"start", "end"},
    ("traffic", "zones"): {"points"},
    ("camera", "ground"): {"pixel"},
}
"""The lists with points, and the keys of the points in each item."""
_DIGITS = 3  # of pixels


def to_fractions(values: Mapping[str, Any]) -> None:
    """Turn the points of settings with `camera.size` into fractions of the frame.

    What is not a point, or not a size, stays: it is refused with all other mistakes.
    """
    if size := _size(values):
        _change(values, lambda x, y: [x / size[0], y / size[1]])


def to_pixels(values: Mapping[str, Any]) -> None:
    """Turn the points of settings with `camera.size` into pixels of such frames."""
    if size := _size(values):
        _change(values, lambda x, y: [round(x * size[0], _DIGITS), round(y * size[1], _DIGITS)])


def _size(values: Mapping[str, Any]) -> Size | None:
    try:
        return TypeAdapter(Size).validate_python(inside(values, "camera", "size"))
    except ValidationError:
        return None


def _change(values: Mapping[str, Any], change: Any) -> None:
    def changed(value: Any) -> Any:
        match value:
            case [int() | float() as x, int() | float() as y]:
                return change(x, y)
            case [*points]:
                return [changed(point) for point in points]
        return value

    for places, keys in _POINTS.items():
        for item in items(values, *places):
            for key in keys & item.keys():
                item[key] = changed(item[key])


def inside(values: Any, *keys: str) -> Any:
    """Return the value of a key in nested sections; None where there is none."""
    for key in keys:
        values = values.get(key) if isinstance(values, dict) else None
    return values


def items(values: Any, *keys: str) -> Iterator[dict[str, Any]]:
    """Yield those items of a list in nested sections that are sections."""
    found = inside(values, *keys)
    yield from (item for item in found or () if isinstance(item, dict) and isinstance(found, list))
