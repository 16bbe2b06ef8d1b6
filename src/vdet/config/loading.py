"""Layers of settings → one `Settings`: the defaults, then YAML files, then assignments."""

import contextlib
import difflib
import reprlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError, create_model
from pydantic_core import ErrorDetails

from vdet.config import document
from vdet.config.detector import NetworkSettings
from vdet.config.document import Document, Key
from vdet.config.points import inside, items, to_fractions
from vdet.config.schema import Section, Settings
from vdet.config.svm import SvmSettings
from vdet.config.tracker import MotionTrackerSettings, RulesTrackerSettings
from vdet.errors import ConfigError
from vdet.plugins import DETECTORS, TRACKERS, load_plugin, plugin_names

_PACKAGE = Path(__file__).parents[1]
# In a wheel the configs lie in the package; in a work tree beside `src`.
_CONFIGS = (_PACKAGE / "configs", _PACKAGE.parents[1] / "configs")

_ALIASES = {"net": "default"}
"""Other names of shipped configs."""


GROUPS = {"detector": DETECTORS, "tracker": TRACKERS}
"""The sections with kinds, and the groups of entry points in which other packages register theirs.

The key `kind` of such a section names its kind.
"""

_BUILT_IN: dict[str, dict[str, type[Section]]] = {
    "detector": {"svm": SvmSettings, "net": NetworkSettings},
    "tracker": {"motion": MotionTrackerSettings, "rules": RulesTrackerSettings},
}


def kind_names(section: str) -> list[str]:
    """Return the names of all kinds of a section, those of vdet first."""
    return plugin_names(GROUPS[section])


def kind_settings(section: str, name: str) -> type[Section]:
    """Return the class of the settings of a kind.

    Raises
    ------
    ConfigError
        There is no such kind, it cannot be loaded, or it has no settings of this name.
    """
    if own := _BUILT_IN[section].get(name):
        return own
    settings = getattr(load_plugin(GROUPS[section], name), "settings", None)
    if isinstance(settings, type) and issubclass(settings, Section) and kind_of(settings) == name:
        return settings
    raise ConfigError(f'{name}: has no settings of kind = "{name}"; repair that package')


def kind_of(settings: type[Section]) -> object:
    """Return the kind that a class of settings is for; None for one without kinds."""
    field = settings.model_fields.get("kind")
    return field and field.default


def kind_of_model(path: Path) -> str | None:
    """Return the kind of detector that a model file is for; None where its ending does not say."""
    kinds = {SvmSettings.model_suffix: "svm", NetworkSettings.model_suffix: "net"}
    return kinds.get(path.suffix.lower())


def find_config(name: str) -> Path:
    """Return the shipped config of a name (`seed`), else the config file at that path (`./seed`).

    Raises
    ------
    ConfigError
        There is neither.
    """
    shipped = shipped_configs()
    if (known := _ALIASES.get(name, name)) in shipped:
        return shipped[known]
    if Path(name).is_file():
        return Path(name)
    raise ConfigError(f"{name}: not found; shipped settings files are: {', '.join(shipped)}")


def shipped_configs() -> dict[str, Path]:
    """Return the shipped config files by name."""
    return {file.stem: file for folder in _CONFIGS for file in sorted(folder.glob("*.yaml"))}


def load_settings(
    paths: Sequence[Path] = (), assignments: Sequence[str] = (), *, detector: str | None = None
) -> Settings:
    """Read settings: defaults, then the files at `paths`, then assignments such as `output.crf=18`.

    `detector` is the kind of detector where no layer chooses one, or a model file that is for one;
    None for the default.

    A list in a later layer replaces the whole list of an earlier one. Where a layer chooses another
    kind of detector or tracker than the layers below, that section starts from the defaults of this
    kind. All assignments are one layer. A relative path in a file is relative to that file, and the
    points in a file with `camera.size` are pixels of such frames.

    Raises
    ------
    ConfigError
        One line for each mistake, with file, line, column, key and what was expected.
    """
    assigned = Document("--set", {})
    for text in assignments:
        assigned = _over(assigned, document.parse_assignment(text))
    layers = [*map(_read_file, paths), assigned]
    for layer in layers:
        to_fractions(layer.values)
    models = [inside(layer.values, "detector", "model") for layer in layers]
    named = [model for model in models if isinstance(model, str)]
    kind = (kind_of_model(Path(named[-1])) if named else None) or detector
    layers = [Document("defaults", {"detector": {"kind": kind}})] * bool(kind) + layers
    merged, chosen = _merge(layers)
    fields: Any = {name: (section, section()) for name, section in chosen.items()}
    model = create_model("Settings", __base__=Settings, **fields)
    try:
        checked = model.model_validate(merged.values)
    except ValidationError as error:
        details = error.errors()
        raise document.config_error(
            (_describe(detail, merged, model) for detail in details), len(details)
        ) from error
    return Settings.model_construct(**dict(checked))


def given_values(paths: Sequence[Path]) -> dict[str, Any]:
    """Return what files say, merged and not checked: points as fractions, paths as they stand.

    Raises
    ------
    ConfigError
        A file cannot be read, is not YAML, or chooses an unknown kind.
    """
    layers = [document.read_document(path) for path in paths]
    for layer in layers:
        to_fractions(layer.values)
    return _merge(layers)[0].values


def _read_file(path: Path) -> Document:
    """Read a file as a layer, with paths as seen from the working folder."""
    layer = document.read_document(path)
    for holder, key in (
        *((region, "mask") for region in items(layer.values, "regions")),
        (inside(layer.values, "detector"), "model"),
    ):
        if isinstance(holder, dict) and isinstance(holder.get(key), str):
            holder[key] = str(path.parent / holder[key])
    return layer


def _over(below: Document, above: Document) -> Document:
    """Lay a document over another one."""
    values = _joined(below.values, above.values)
    return Document(below.name, values, below.places | above.places)


def _joined(below: Any, above: Any) -> Any:
    if isinstance(below, dict) and isinstance(above, dict):
        return below | {key: _joined(below.get(key), value) for key, value in above.items()}
    return above


def _merge(layers: Sequence[Document]) -> tuple[Document, dict[str, type[Section]]]:
    """Return the layers as one, and the class of the settings of each chosen kind.

    Raises
    ------
    ConfigError
        A layer chooses an unknown kind.
    """
    merged = Document("settings", {})
    chosen: dict[str, type[Section]] = {name: type(getattr(Settings(), name)) for name in GROUPS}
    for layer in layers:
        for name in GROUPS:
            section = layer.values.get(name)
            kind = section.get("kind") if isinstance(section, dict) else None
            if isinstance(kind, str) and kind != kind_of(chosen[name]):
                try:
                    chosen[name] = kind_settings(name, kind)
                except ConfigError as error:
                    place = layer.place_of((name, "kind"))
                    raise ConfigError(f"{place}: {name}.kind: {error}") from error
                merged.values[name] = {}
        merged = _over(merged, layer)
    return merged, chosen


_EXPECTED = {"model_type": "must be a section, key: value", "tuple_type": "must be a list"}


def _describe(detail: ErrorDetails, merged: Document, model: type[Settings]) -> str:
    key = tuple(detail["loc"])
    named = f"{document.format_key(key)}: " if key else ""
    return f"{merged.place_of(key)}: {named}{_expected(detail, key, model)}"


def _expected(detail: ErrorDetails, key: Key, model: type[Settings]) -> str:
    match detail["type"]:
        case "extra_forbidden" | "invalid_key":
            return _other_kind(key, model) or f"unknown setting{_suggestion(key, model)}"
        case "missing":
            return "is required"
        case "value_error":
            return str(detail["ctx"]["error"])
        case "literal_error" if key[1:] == ("kind",) and key[0] in GROUPS:
            message = f"must be {' or '.join(kind_names(str(key[0])))}"
        case _:
            message = _EXPECTED.get(detail["type"]) or detail["msg"].removeprefix("Input ")
            message = message.replace("should be", "must be", 1)
    return f"{message} (got {reprlib.repr(detail['input'])})"


def _other_kind(key: Key, model: type[Settings]) -> str:
    """Say which other kind a key belongs to; nothing where it belongs to none."""
    section, *inside = key
    if section not in GROUPS or not inside:
        return ""
    current, owners = model.model_fields[section].default.kind, []
    for kind in kind_names(section):
        with contextlib.suppress(ConfigError):  # another package's kind that cannot be loaded
            if kind != current and inside[0] in kind_settings(section, kind).model_fields:
                owners.append(kind)
    if not owners:
        return ""
    return f"belongs to {section}.kind: {' or '.join(owners)}, and has no effect with {current}"


def _suggestion(key: Key, model: type[Settings]) -> str:
    """Name the key that is meant, or all keys beside it; nothing where it is in no section."""
    within: Any = model
    for part in key[:-1]:
        if _is_section(within):
            within = within.model_fields[str(part)].annotation
        else:  # an item of a list
            within = next(filter(_is_section, get_args(within)), None)
    names = list(within.model_fields) if _is_section(within) else []
    if close := difflib.get_close_matches(str(key[-1]), names, n=1):
        return f"; did you mean {close[0]}?"
    return f"; known settings: {', '.join(names)}" if names else ""


def _is_section(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, Section)
