"""Layers of settings → one `Settings`: the defaults, then YAML files, then assignments."""

import contextlib
import difflib
import reprlib
from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from vdet.config import document
from vdet.config.document import Document, Key
from vdet.config.kinds import GROUPS, default_kind, kind_of_model, kind_settings
from vdet.config.places import inside, to_fractions, with_changed
from vdet.config.schema import Section, Settings
from vdet.errors import ConfigError
from vdet.plugins import plugin_names

MAX_MISTAKES = 20
"""Maximum number of mistakes that are shown; the others are counted."""

_PACKAGE = Path(__file__).parents[1]
# In a wheel the configs lie in the package; in a work tree beside `src`.
_CONFIGS = (_PACKAGE / "configs", _PACKAGE.parents[1] / "configs")


def find_config(name: str) -> Path:
    """Return the shipped config of this name (`seed`), else the config file at this path.

    Raises
    ------
    ConfigError
        There is neither.
    """
    shipped = shipped_configs()
    path = shipped.get("default" if name == "net" else name, Path(name))
    if not path.is_file():
        raise ConfigError(f"{name}: not found; shipped settings files are: {', '.join(shipped)}")
    return path


def shipped_configs() -> dict[str, Path]:
    """Return the shipped config files by name."""
    return {file.stem: file for folder in _CONFIGS for file in sorted(folder.glob("*.yaml"))}


def load_settings(
    paths: Sequence[Path] = (), assignments: Sequence[str] = (), *, detector: str | None = None
) -> Settings:
    """Read settings: defaults, then the files at `paths`, then assignments such as `output.crf=18`.

    `detector` is the kind of detector if no layer chooses one, or a model file, which tells the
    kind; None for the default.

    A list in a later layer replaces the whole list of an earlier one. Where a layer chooses another
    kind of detector or tracker than the layers below, that section starts from the defaults of this
    kind. All assignments are one layer. A relative path in a file is relative to that file, and the
    points in a file with `camera.size` are pixels of such frames.

    Raises
    ------
    ConfigError
        One line for each mistake, with file, line, column, key and what was expected.
    """
    assigned = reduce(_over, map(document.parse_assignment, assignments), Document("--set", {}))
    layers = [*map(_read_file, paths), _with_fractions(assigned)]
    models = [inside(layer.values, "detector", "model") for layer in layers]
    for model in filter(lambda model: isinstance(model, str), models):
        detector = kind_of_model(Path(model)) or detector
    chosen = Document("defaults", {"detector": {"kind": detector}} if detector else {})
    merged = reduce(_with_kinds_over, layers, chosen)
    try:
        return Settings.model_validate(merged.values)
    except ValidationError as error:
        mistakes = error.errors()
        lines = [_describe(mistake, merged) for mistake in mistakes[:MAX_MISTAKES]]
        if len(mistakes) > MAX_MISTAKES:
            lines.append(f"… and {len(mistakes) - MAX_MISTAKES} more mistakes")
        raise ConfigError(*lines) from error


def given_values(paths: Sequence[Path]) -> dict[str, Any]:
    """Return the merged values of files, unchecked: points as fractions, paths as written.

    Raises
    ------
    ConfigError
        A file cannot be read, or is not YAML.
    """
    layers = (_with_fractions(document.read_document(path)) for path in paths)
    return reduce(_with_kinds_over, layers, Document("settings", {})).values


def _with_fractions(layer: Document) -> Document:
    return replace(layer, values=to_fractions(layer.values))


def _read_file(path: Path) -> Document:
    """Read a file as a layer, with points as fractions and paths relative to the working folder."""

    def from_here(name: Any) -> Any:
        return str(path.parent / name) if isinstance(name, str) else name

    layer = _with_fractions(document.read_document(path))
    found = {
        name: with_changed(section, {"mask", "model"}, from_here)
        for name, section in layer.values.items()
        if name in ("detector", "regions")  # in `labels.roles` these keys may be labels
    }
    return replace(layer, values=layer.values | found)


def _over(below: Document, above: Document) -> Document:
    """Lay a document over another one."""
    values = _joined(below.values, above.values)
    return Document(below.name, values, below.places | above.places)


def _joined(below: Any, above: Any) -> Any:
    if isinstance(below, dict) and isinstance(above, dict):
        return below | {key: _joined(below.get(key), value) for key, value in above.items()}
    return above


def _with_kinds_over(below: Document, above: Document) -> Document:
    """Lay a document over another one; a section whose kind it changes starts anew."""
    values = dict(below.values)
    for name in GROUPS:
        kind = inside(above.values, name, "kind")
        if kind is not None and kind != (inside(values, name, "kind") or default_kind(name)):
            values[name] = {}
    return _over(Document(below.name, values, below.places), above)


_EXPECTED = {
    "model_type": "must be a section, key: value",
    "tuple_type": "must be a list",
    "zoneinfo_str": "must be a time zone, such as Europe/Berlin",
}


def _describe(mistake: ErrorDetails, merged: Document) -> str:
    key = tuple(mistake["loc"])
    named = f"{document.format_key(key)}: " if key else ""
    return f"{merged.place_of(key)}: {named}{_expected(mistake, key)}"


def _expected(mistake: ErrorDetails, key: Key) -> str:
    match mistake["type"]:
        case "extra_forbidden":
            return _unknown(key, mistake["input"])
        case "missing":
            return "is required"
        case "value_error":
            return str(mistake["ctx"]["error"])
    message = _EXPECTED.get(mistake["type"]) or mistake["msg"].removeprefix("Input ")
    message = message.replace("should be", "must be", 1)
    return f"{message} (got {reprlib.repr(mistake['input'])})"


def _unknown(key: Key, section: type[Section]) -> str:
    """Return a hint: the kind that has this key, the key probably meant, or all known ones."""
    name, group, known = str(key[-1]), str(key[0]), list(section.model_fields)
    if len(key) == 2 and group in GROUPS:
        owners = [kind for kind in plugin_names(GROUPS[group]) if name in _keys_of(group, kind)]
        if owners:
            words = f"belongs to {group}.kind: {' or '.join(owners)}, and has no effect with"
            return f"{words} {section.model_fields['kind'].default}"
    if close := difflib.get_close_matches(name, known, n=1):
        return f"unknown setting; did you mean {close[0]}?"
    return f"unknown setting; known settings: {', '.join(known)}"


def _keys_of(group: str, kind: str) -> Collection[str]:
    with contextlib.suppress(ConfigError):  # another package's kind that cannot be loaded
        return kind_settings(group, kind).model_fields
    return ()
