"""Layers of settings → one `Settings`: built-in, then a YAML file, then assignments."""

import difflib
import itertools
import reprlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError, create_model
from pydantic_core import ErrorDetails

from vdet.config.document import Document, Key, mistakes, parse_assignment, read_document
from vdet.config.kinds import UNIONS, Kinds, kind_names, section_of_kind
from vdet.config.schema import Section, Settings
from vdet.errors import ConfigError
from vdet.files import printable

_PACKAGE = Path(__file__).parents[1]
# In a wheel the configs lie in the package; in a work tree beside `src`.
_CONFIGS = (_PACKAGE / "configs", _PACKAGE.parents[1] / "configs")


def find_config(name: str) -> Path:
    """Return the config file at the path `name`, or else the shipped one of that name (`seed`).

    Raises
    ------
    ConfigError
        There is neither.
    """
    path = Path(name)
    if path.is_file():
        return path
    shipped = {file.stem: file for folder in _CONFIGS for file in sorted(folder.glob("*.yaml"))}
    if name in shipped:
        return shipped[name]
    raise ConfigError(f"{name}: no such file; shipped configs are: {', '.join(shipped)}")


def load_settings(path: Path | None = None, assignments: Sequence[str] = ()) -> Settings:
    """Read settings: defaults, then the file at `path`, then assignments such as `input.crf=18`.

    A list in a later layer replaces the whole list of an earlier one; an assignment may name one
    item of it (`detector.search.windows.0.step=2`). Where a layer chooses another kind of detector
    or method of tracking than the layers below, that section starts from the defaults of this kind.

    Raises
    ------
    ConfigError
        One line for each mistake, with file, line, column, key and what was expected.
    """
    layers = [read_document(path)] if path else []
    assigned, errors = _read_assignments(assignments)
    layers.append(assigned)
    try:
        values, places, kinds = _merge(layers)
    except ConfigError as error:
        raise mistakes([*errors, *str(error).splitlines()], len(errors) + 1) from error
    details: list[ErrorDetails] = []
    try:
        settings = _validate(values, kinds)
    except ValidationError as error:
        details = error.errors()
    if errors or details:
        described = (_describe(detail, places, kinds) for detail in details)
        raise mistakes(itertools.chain(errors, described), len(errors) + len(details))
    return settings


def _read_assignments(assignments: Sequence[str]) -> tuple[Document, list[str]]:
    """Join assignments to one layer; what cannot be read is returned as lines of errors."""
    values: Any = {}
    places: dict[Key, str] = {}
    errors: list[str] = []
    for text in assignments:
        try:
            document = parse_assignment(text)
        except ConfigError as error:
            errors.append(str(error))
        else:
            values = _overlay(values, document.values)
            places |= document.places
    return Document(values, places), errors


def _merge(layers: Sequence[Document]) -> tuple[dict[str, Any], dict[Key, str], Kinds]:
    """Lay the layers over the defaults; return values, places and the kind of each union."""
    values: dict[str, Any] = Settings().model_dump(mode="json")
    kinds = {name: section_of_kind(name, values[name][key]) for name, key in UNIONS.items()}
    places: dict[Key, str] = {}
    for layer in layers:
        for name, key in UNIONS.items():
            given = layer.values.get(name)
            kind = given.get(key) if isinstance(given, dict) else None
            if isinstance(kind, str) and kind != values[name][key]:
                kinds[name] = _chosen(name, kind, layer)
                values[name] = kinds[name]().model_dump(mode="json")
        values = _overlay(values, layer.values)
        places |= layer.places
    return values, places, kinds


def _chosen(name: str, kind: str, layer: Document) -> type[Section]:
    try:
        return section_of_kind(name, kind)
    except ConfigError as error:
        key: Key = (name, UNIONS[name])
        raise ConfigError(f"{_place(key, layer.places)}: {format_key(key)}: {error}") from error


def _validate(values: Mapping[str, Any], kinds: Kinds) -> Settings:
    """Check values against the sections of the chosen kinds."""
    fields: Any = {name: (kind, ...) for name, kind in kinds.items()}
    checked = create_model("Settings", __base__=Settings, **fields).model_validate(values)
    return Settings.model_construct(
        **{name: getattr(checked, name) for name in Settings.model_fields}
    )


def _overlay(below: Any, above: Any) -> Any:
    if isinstance(below, dict) and above is None:  # a section of which nothing is given
        return below
    if isinstance(below, dict) and isinstance(above, dict):
        return below | {key: _overlay(below.get(key), value) for key, value in above.items()}
    if (
        isinstance(below, list)
        and isinstance(above, dict)
        and all(k in range(len(below)) for k in above)
    ):
        return [_overlay(item, above[i]) if i in above else item for i, item in enumerate(below)]
    return above


def _describe(detail: ErrorDetails, places: dict[Key, str], kinds: Kinds) -> str:
    key = tuple(detail["loc"])
    place = _place(key, places)
    expected = _expected(detail, kinds)
    return f"{place}: {format_key(key)}: {expected}" if key else f"{place}: {expected}"


def _place(key: Key, places: Mapping[Key, str]) -> str:
    """Return the place of `key`, or of the nearest thing in or around it that was written down."""
    if within := [place for at, place in places.items() if at[: len(key)] == key]:
        return within[0]
    return _place(key[:-1], places)


def format_key(key: Key) -> str:
    """Write a path as a user would: `detector.search.windows[0].size`."""
    text = ""
    for part in key:
        name = printable(str(part))
        text += f"[{name}]" if isinstance(part, int) else f".{name}" if text else name
    return text


_EXPECTED = {
    "model_type": "should be a section, key: value",
    "tuple_type": "should be a list, or in --set the number of an item that it has, from 0",
}


def _expected(detail: ErrorDetails, kinds: Kinds) -> str:
    match detail["type"]:
        case "extra_forbidden" | "invalid_key":
            key = tuple(detail["loc"])
            return _belongs(key, kinds) or f"is no setting{_suggestion(key, kinds)}"
        case "missing":
            return "is missing"
        case "value_error":
            return str(detail["ctx"]["error"])
    message = _EXPECTED.get(detail["type"]) or detail["msg"].removeprefix("Input ")
    return f"{message} (got {reprlib.repr(detail['input'])})"


def _belongs(key: Key, kinds: Kinds) -> str:
    """Say which other kind a key belongs to; nothing where it belongs to none."""
    if len(key) < 2 or key[0] not in UNIONS:
        return ""
    name = str(key[0])
    choice = UNIONS[name]
    chosen = kinds[name].model_fields[choice].default
    owners = [
        kind
        for kind in kind_names(name)
        if kind != chosen and key[1] in section_of_kind(name, kind).model_fields
    ]
    if not owners:
        return ""
    owner = " or ".join(owners)
    return f"belongs to {name}.{choice}: {owner}, and has no effect with {chosen}"


def _suggestion(key: Key, kinds: Kinds) -> str:
    names = _names_beside(key, kinds)
    if close := difflib.get_close_matches(str(key[-1]), names, n=1):
        return f"; did you mean {close[0]}?"
    return f"; known here: {', '.join(names)}" if names else ""


def _names_beside(key: Key, kinds: Kinds) -> list[str]:
    section: Any = Settings
    for depth, part in enumerate(key[:-1]):
        if depth == 0 and part in kinds:
            section = kinds[str(part)]
        elif not isinstance(part, int):
            section = section.model_fields[part].annotation
        elif args := get_args(section):  # tuple[WindowSettings, ...]
            section = args[0]
    return list(section.model_fields) if issubclass(section, BaseModel) else []
