"""Layers of settings → one `Settings`: built-in, then a YAML file, then assignments."""

import difflib
import itertools
import reprlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from vdet.config.document import Document, Key, mistakes, parse_assignment, read_document
from vdet.config.schema import FeatureSettings, Settings
from vdet.errors import ConfigError
from vdet.files import printable


@dataclass(frozen=True, slots=True)
class LoadedSettings:
    """Settings, and whether their features were asked for rather than left at the default."""

    settings: Settings
    features: FeatureSettings | None
    """The feature settings where a file or an assignment gives any, else None."""


_TAG = "method"
"""Names the kind of a section that has several."""

_TAGGED = {name for name, field in Settings.model_fields.items() if field.discriminator == _TAG}


def load_settings(path: Path | None = None, assignments: Sequence[str] = ()) -> LoadedSettings:
    """Read settings: defaults, then the file at `path`, then assignments such as `heat.frames=3`.

    A list in a later layer replaces the whole list of an earlier one; an assignment may name one
    item of it (`search.windows.0.step=2`).

    Raises
    ------
    ConfigError
        One line for each mistake, with file, line, column, key and what was expected.
    """
    defaults = Settings().model_dump(mode="json")
    layers = [read_document(path)] if path else []
    errors: list[str] = []
    for text in assignments:
        try:
            layers.append(parse_assignment(text))
        except ConfigError as error:
            errors.append(str(error))
    values, places = _merge(defaults, layers)
    details: list[ErrorDetails] = []
    try:
        settings = Settings.model_validate(values)
    except ValidationError as error:
        details = error.errors()
    if errors or details:
        described = (_describe(detail, places) for detail in details)
        raise mistakes(itertools.chain(errors, described), len(errors) + len(details))
    given = any("features" in layer.values for layer in layers)
    return LoadedSettings(settings, settings.features if given else None)


def _merge(values: dict[str, Any], layers: Sequence[Document]) -> tuple[Any, dict[Key, str]]:
    merged: Any = values
    places: dict[Key, str] = {}
    for layer in layers:
        merged = _overlay(merged, layer.values)
        places |= layer.places
    return merged, places


def _overlay(below: Any, above: Any) -> Any:
    if isinstance(below, dict) and above is None:  # a section of which nothing is given
        return below
    if isinstance(below, dict) and isinstance(above, dict):
        if above.get(_TAG, below.get(_TAG)) != below.get(_TAG):
            below = {}  # another kind of section, with its own defaults
        return below | {key: _overlay(below.get(key), value) for key, value in above.items()}
    if (
        isinstance(below, list)
        and isinstance(above, dict)
        and all(k in range(len(below)) for k in above)
    ):
        return [_overlay(item, above[i]) if i in above else item for i, item in enumerate(below)]
    return above


def _describe(detail: ErrorDetails, places: dict[Key, str]) -> str:
    key = _written_key(tuple(detail["loc"]))
    place = _place(key, places)
    expected = _expected(detail)
    return f"{place}: {format_key(key)}: {expected}" if key else f"{place}: {expected}"


def _written_key(key: Key) -> Key:
    """Return the key as users write it: without the kind of a section, which pydantic adds."""
    return key if len(key) < 2 or key[0] not in _TAGGED else (key[0], *key[2:])


def _place(key: Key, places: dict[Key, str]) -> str:
    """Return the place of `key`, or of the nearest thing in or around it that was written down."""
    if within := [place for at, place in places.items() if at[: len(key)] == key]:
        return within[0]
    return _place(key[:-1], places)


def format_key(key: Key) -> str:
    """Write a path as a user would: `search.windows[0].size`."""
    text = ""
    for part in key:
        name = printable(str(part))
        text += f"[{name}]" if isinstance(part, int) else f".{name}" if text else name
    return text


_EXPECTED = {
    "model_type": "should be a section, key: value",
    "tuple_type": "should be a list, or in --set the number of an item that it has, from 0",
}


def _expected(detail: ErrorDetails) -> str:
    match detail["type"]:
        case "extra_forbidden" | "invalid_key":
            return f"is no setting{_suggestion(tuple(detail['loc']))}"
        case "missing":
            return "is missing"
        case "value_error":
            return str(detail["ctx"]["error"])
    message = _EXPECTED.get(detail["type"]) or detail["msg"].removeprefix("Input ")
    return f"{message} (got {reprlib.repr(detail['input'])})"


def _suggestion(key: Key) -> str:
    names = _names_beside(key)
    if close := difflib.get_close_matches(str(key[-1]), names, n=1):
        return f"; did you mean {close[0]}?"
    return f"; known here: {', '.join(names)}" if names else ""


def _names_beside(key: Key) -> list[str]:
    section: Any = Settings
    for part in key[:-1]:
        if isinstance(section, UnionType):  # the section that the tag names
            (section,) = [k for k in get_args(section) if k.model_fields[_TAG].default == part]
        elif not isinstance(part, int):
            section = section.model_fields[part].annotation
        elif args := get_args(section):  # tuple[WindowSettings, ...]
            section = args[0]
    return list(section.model_fields) if issubclass(section, BaseModel) else []
