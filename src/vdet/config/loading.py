"""Layers of settings → one `Settings`: the defaults, then YAML files, then assignments."""

import copy
import difflib
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from vdet.config import document
from vdet.config.camera import GroundPoint
from vdet.config.document import Document, Key
from vdet.config.kinds import GROUPS, default_kind, kind_of_model, tracker_defaults
from vdet.config.schema import LaneSettings, Section, Settings
from vdet.config.section import S
from vdet.config.shapes import FRACTIONS, LineSettings, RegionSettings, Shape, ZoneSettings
from vdet.errors import ConfigError

MAX_MISTAKES = 20
"""Maximum number of mistakes that are shown."""

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
    paths: Sequence[Path] = (),
    assignments: Sequence[str] = (),
    options: Sequence[Document] = (),
    *,
    detector: str | None = None,
) -> Settings:
    """Read settings: defaults, then the files at `paths`, then assignments such as `output.crf=18`.

    `options` are values from the command line, after the assignments.
    `detector` is the kind of detector if no layer chooses one, or a model file, which tells the
    kind; None for the default.

    A list in a later layer replaces the whole list of an earlier one. Where a layer chooses another
    kind of detector or tracker than the layers below, that section starts from the defaults of this
    kind. All assignments and options are one layer. A relative path in a file is relative to that
    file, and the points in a file with `camera.size` are pixels of such frames.

    Raises
    ------
    ConfigError
        One line for each mistake, with file, line, column, key and what was expected.
    """
    single = [*map(document.parse_assignment, assignments), *options]
    assigned = reduce(_over, single, Document("assignments", {}))
    layers = [*map(_read_layer, paths), _with_sizes(assigned)]
    for layer in layers:
        if isinstance(model := value_at(layer.values, "detector", "model"), str):
            detector = kind_of_model(Path(model)) or detector
    chosen = Document("defaults", {"detector": {"kind": detector}} if detector else {})
    merged = reduce(_with_kinds_over, layers, chosen)
    kind = value_at(merged.values, "detector", "kind") or default_kind("detector")
    tracker = tracker_defaults(kind)
    defaults = Document("defaults", {"tracker": tracker} if tracker else {})
    return validated(Settings, _with_kinds_over(defaults, merged))


def validated(kind: type[S], read: Document) -> S:
    """Return the values of a document as a section of this kind; errors as `load_settings`."""
    try:
        return kind.model_validate(read.values)
    except ValidationError as error:
        mistakes = error.errors()[:MAX_MISTAKES]
        raise ConfigError(*(_describe(mistake, read) for mistake in mistakes)) from error


def given_values(configs: Sequence[str]) -> dict[str, Any]:
    """Return the merged values of settings files, unchecked, without those of shipped ones.

    Each shape has its size, and paths are as written.

    Raises
    ------
    ConfigError
        A file cannot be read, or is not YAML.
    """
    shipped = shipped_configs().values()
    paths = [path for path in map(find_config, configs) if path not in shipped]
    layers = (_with_sizes(document.read_document(path)) for path in paths)
    return reduce(_with_kinds_over, layers, Document("settings", {})).values


def _read_layer(path: Path) -> Document:
    """Read a file as a layer, with paths relative to the working folder."""
    layer = _with_sizes(document.read_document(path))
    regions = [region for kind, region in shapes_in(layer.values) if kind is RegionSettings]
    for section in (layer.values.get("detector"), layer.values.get("survey"), *regions):
        for key in ("model", "mask", "picture"):
            if isinstance(section, dict) and isinstance(section.get(key), str):
                section[key] = str(path.parent / section[key])
    return layer


def _with_sizes(layer: Document) -> Document:
    """Add to each shape of a layer the size that its points are given for."""
    size = value_at(layer.values, "camera", "size")
    for _, shape in shapes_in(layer.values):
        shape.setdefault("size", list(FRACTIONS) if size is None else size)
    return layer


_SHAPES: dict[tuple[str, ...], type[Shape]] = {
    ("camera", "ground"): GroundPoint,
    ("regions",): RegionSettings,
    ("traffic", "lines"): LineSettings,
    ("traffic", "zones"): ZoneSettings,
    ("lanes",): LaneSettings,
}
"""Where settings have shapes: a list of them, or one."""


def shapes_in(values: dict[str, Any]) -> Iterator[tuple[type[Shape], dict[str, Any]]]:
    """Yield the plain values of each shape in plain settings, with its class."""
    for keys, kind in _SHAPES.items():
        items = value_at(values, *keys)
        for item in items if isinstance(items, list) else [items]:
            if isinstance(item, dict) and (kind is not LaneSettings or "points" in item):
                yield kind, item


def in_pixels(values: Mapping[str, Any], width: int, height: int) -> dict[str, Any]:
    """Return `given_values` for frames of this size: `camera.size`, and all points in its pixels.

    Raises
    ------
    ConfigError
        The points are for frames of another aspect ratio.
    """
    scaled = copy.deepcopy({**values, "camera": values.get("camera") or {}})
    scaled["camera"]["size"] = [width, height]
    for kind, item in shapes_in(scaled):
        shape = kind.model_validate(item).for_frames(width, height)
        points = shape.model_dump(mode="json", include={*kind.point_fields} & set(item))
        item |= {name: _rounded(value) for name, value in points.items()}
        item.pop("size", None)
    return scaled


def _rounded(value: Any) -> Any:
    return [*map(_rounded, value)] if isinstance(value, list) else value and round(value, 3)


def _over(below: Document, above: Document) -> Document:
    """Return a document with the values of `above` instead of those of `below`."""
    values = _joined(below.values, above.values)
    return Document(below.name, values, below.positions | above.positions)


def _joined(below: Any, above: Any) -> Any:
    if isinstance(below, dict) and isinstance(above, dict):
        return below | {key: _joined(below.get(key), value) for key, value in above.items()}
    return above


def _with_kinds_over(below: Document, above: Document) -> Document:
    """Do as `_over`; a section whose kind `above` changes starts from its defaults."""
    values = dict(below.values)
    for name in GROUPS:
        kind = value_at(above.values, name, "kind")
        if kind is not None and kind != (value_at(values, name, "kind") or default_kind(name)):
            values[name] = {}
    return _over(Document(below.name, values, below.positions), above)


def value_at(values: Any, *keys: str) -> Any:
    """Return the value of a key in nested sections; None where there is none."""
    for key in keys:
        values = values.get(key) if isinstance(values, dict) else None
    return values


_EXPECTED = {
    "model_type": "must be a section, key: value",
    "string_type": "must be text; quote it",
    "string_unicode": "must be UTF-8; rename the file or folder, or use a relative path",
    "tuple_type": "must be a list",
    "zoneinfo_str": "must be a time zone, such as Europe/Berlin",
}


def _describe(mistake: ErrorDetails, merged: Document) -> str:
    key = tuple(mistake["loc"])
    position = merged.position_of(key)
    is_named = key and (position == "--set" or not position.startswith("--"))
    named = f"{document.format_key(key)}: " if is_named else ""  # else the option says it
    return f"{position}: {named}{_expected(mistake, key)}"


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
    """Return a hint: the key of a section that is probably meant, or all keys."""
    keys = section.keys()
    problem = "unknown setting"
    if "kind" in keys:
        problem += f" of {key[0]}.kind: {section.model_fields['kind'].default}"
    if close := difflib.get_close_matches(str(key[-1]), keys, n=1):
        return f"{problem}; did you mean {close[0]}?"
    return f"{problem}; known settings: {', '.join(keys)}"
