"""Read settings, and print them.

Layers become one `Settings`: the defaults, then YAML files, then assignments. The plain values of
YAML text keep their position in the text, so that errors can name it. Printed, settings are YAML
with a comment on every key, as `vdet config` shows them.
"""

import ast
import contextlib
import copy
import difflib
import inspect
import re
import reprlib
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from functools import reduce
from inspect import isclass
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args, get_origin

import yaml
from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, to_jsonable_python
from yaml.constructor import ConstructorError

from vdet.config.kinds import GROUPS, default_kind, kind_of_model, tracker_defaults
from vdet.config.scene import (
    FRACTIONS,
    GroundPoint,
    LineSettings,
    RegionSettings,
    Shape,
    ZoneSettings,
)
from vdet.config.schema import LaneSettings, Section, Settings
from vdet.config.section import S
from vdet.errors import ConfigError, printable
from vdet.files import read_whole

MAX_BYTES = 100_000
"""Ten times the size of all settings with all their comments."""

_WORDS = ("yes", "no", "on", "off")
_LEADING_ZERO = re.compile(r"[-+]?0+([0-9]+)")
_CANNOT_START = re.compile("found character '[%@`]' that cannot start any token")

Key = tuple[str | int, ...]
"""Path to a value from the root: `("search", "windows", 0, "size")`."""

MAX_MISTAKES = 20
"""Maximum number of mistakes that are shown."""

_PACKAGE = Path(__file__).parents[1]
# In a wheel the configs lie in the package; in a work tree beside `src`.
_CONFIGS = (_PACKAGE / "configs", _PACKAGE.parents[1] / "configs")

_SHAPES: dict[tuple[str, ...], type[Shape]] = {
    ("camera", "ground"): GroundPoint,
    ("regions",): RegionSettings,
    ("traffic", "lines"): LineSettings,
    ("traffic", "zones"): ZoneSettings,
    ("lanes",): LaneSettings,
}
"""Where settings have shapes: a list of them, or one."""

_EXPECTED = {
    "model_type": "must be a section, key: value",
    "string_type": "must be text; quote it",
    "string_unicode": "must be UTF-8; rename the file or folder, or use a relative path",
    "tuple_type": "must be a list",
    "zoneinfo_str": "must be a time zone, such as Europe/Berlin",
}

HEADING = "# vdet settings. `vdet config` prints the effective ones."
WIDTH = 100


@dataclass(frozen=True, slots=True)
class Document:
    """Values read from the source `name`, and the position of each key: `file:line:column`."""

    name: str
    values: dict[str, Any]
    positions: dict[Key, str] = field(default_factory=dict)

    def position_of(self, key: Key) -> str:
        """Return the position of a key, or of the nearest one in or around it."""
        for length in range(len(key), -1, -1):
            for candidate, position in self.positions.items():
                if candidate[:length] == key[:length]:
                    return position
        return self.name


def format_key(key: Key) -> str:
    """Return a path as users write it: `detector.search.windows[0].size`."""
    text = ""
    for part in key:
        name = printable(str(part))
        text += f"[{name}]" if isinstance(part, int) else f".{name}" if text else name
    return text


class _Loader(yaml.SafeLoader):
    """Safe YAML without aliases, duplicate keys, and keys that are not text.

    A few aliases can expand to billions of values. `key_marks` are the positions of all keys.
    """

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.key_marks: dict[Key, yaml.Mark] = {}

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()  # type: ignore[no-untyped-call]
            raise _rejected(
                "aliases (*name) are not accepted; quote text that begins with *", event
            )
        return super().compose_node(parent, index)

    def read(self, node: yaml.Node, key: Key) -> Any:
        """Return the value of a node, and add the marks of all keys in it."""
        self.key_marks.setdefault(key, node.start_mark)
        if isinstance(node, yaml.SequenceNode):
            return [self.read(item, (*key, index)) for index, item in enumerate(node.value)]
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, key)
        assert isinstance(node, yaml.ScalarNode)
        if node.style is None and (digits := _LEADING_ZERO.fullmatch(node.value)):
            advice = f"write {digits[1]}, or quote it if it is text"
            raise _rejected(f"{node.value} is octal in YAML, as it begins with 0; {advice}", node)
        try:
            value = self.construct_object(node)
        except ValueError as error:
            raise _rejected(str(error), node) from error
        # YAML 1.1 takes 2026-05-01, 15:00 and no for other kinds. Settings convert what they need.
        if ":" in node.value or isinstance(value, date) or node.value.lower() in _WORDS:
            return node.value
        return value

    def _mapping(self, node: yaml.MappingNode, key: Key) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for name, value in node.value:
            if not isinstance(name, yaml.ScalarNode):
                raise _rejected(f"a {name.id} cannot be a key", name)
            if name.value in values:
                raise _rejected(f"{printable(name.value)} appears twice; remove one", name)
            self.key_marks[(*key, name.value)] = name.start_mark
            values[name.value] = self.read(value, (*key, name.value))
        return values


def _rejected(problem: str, node: Any) -> ConstructorError:
    return ConstructorError(None, None, problem, node.start_mark)


# In YAML 1.1 a number with an exponent needs a dot and a sign: `1.0e-3`.
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+0123456789."),
)


def read_document(path: Path, *, limit: int = MAX_BYTES, what: str = "settings file") -> Document:
    """Read a YAML file of settings, or of something else, of at most `limit` bytes.

    Raises
    ------
    ConfigError
        The file cannot be read, is not YAML, or gives a key twice.
    """
    data = read_whole(path, limit=limit, what=what, error=ConfigError)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text; save it as UTF-8") from error
    return parse_document(text, str(path))


def parse_document(text: str, name: str) -> Document:
    """Read YAML text; `name` is its name in messages. Raises `ConfigError`."""
    values, positions = _parse(text, name)
    if not isinstance(values, dict | None):
        got = reprlib.repr(values)
        raise ConfigError(f"{name}:1:1: expected settings (key: value), got {got}")
    return Document(name, values or {}, positions)


def parse_assignment(text: str, name: str = "assignments") -> Document:
    """Parse `key.key=value`; `name` says where it is from, in messages.

    Raises
    ------
    ConfigError
        There is no `=`, a part of the key is missing, or the value is not YAML.
    """
    key, equals, value = text.partition("=")
    path: Key = tuple(key.strip().split("."))
    if not equals or not all(path):
        raise ConfigError(f"{name}: {text}: expected KEY=VALUE, as in output.crf=18")
    parsed, positions = _parse(value, name)
    return given(path, parsed, name, positions)


def given(path: Key, value: Any, option: str, keys: Iterable[Key] = ()) -> Document:
    """Return the document of a value that an option gives; `keys` are those inside it."""
    for part in reversed(path):
        value = {part: value}
    return Document(option, value, dict.fromkeys([path, *((*path, *key) for key in keys)], option))


def _parse(text: str, name: str) -> tuple[Any, dict[Key, str]]:
    """Return the value of YAML text, and the positions of all its keys. Raises `ConfigError`."""
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        value = None if node is None else loader.read(node, ())
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        position = f"{name}:{mark.line + 1}:{mark.column + 1}" if mark else name
        problem = _CANNOT_START.sub(r"\g<0>; quote the text", error.problem or error.context or "")
        raise ConfigError(f"{position}: is not YAML: {problem}") from error
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:
        raise ConfigError(f"{name}: is not YAML: {' '.join(str(error).split())}") from error
    marks = loader.key_marks.items()
    return value, {key: f"{name}:{mark.line + 1}:{mark.column + 1}" for key, mark in marks}


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
    single = [*map(parse_assignment, assignments), *options]
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
    layers = (_with_sizes(read_document(path)) for path in paths)
    return reduce(_with_kinds_over, layers, Document("settings", {})).values


def _read_layer(path: Path) -> Document:
    """Read a file as a layer, with paths relative to the working folder."""
    layer = _with_sizes(read_document(path))
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


def _describe(mistake: ErrorDetails, merged: Document) -> str:
    key = tuple(mistake["loc"])
    position = merged.position_of(key)
    is_named = key and (position == "--set" or not position.startswith("--"))
    named = f"{format_key(key)}: " if is_named else ""  # else the option says it
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


def render_settings(settings: Settings) -> str:
    """Write settings as YAML; reading the text gives the same settings again.

    Each key is preceded by what it means; the keys of list items stand before the list.
    """
    # An item says only what it has, and its size only if it differs from that of the file.
    values = to_jsonable_python(settings, exclude_none=True)
    for _, shape in shapes_in(values):
        if shape["size"] == list(settings.camera.size or FRACTIONS):
            del shape["size"]
    return "\n".join([HEADING, *_section(settings, values, "")]) + "\n"


def explanations(section: type[Section]) -> Mapping[str, str]:
    """Return what each key of a section means.

    It is the description of its field, or else the text below the field in the source. That is read
    here, and not by pydantic: parsing all sections would take a third of the start of a command.
    """
    texts: dict[str, str] = {}
    for item in reversed(section.__mro__):
        if not issubclass(item, Section):
            continue
        with contextlib.suppress(OSError):  # its source is not there
            (kind,) = ast.parse(textwrap.dedent(inspect.getsource(item))).body
            for field, text in pairwise(kind.body if isinstance(kind, ast.ClassDef) else ()):
                match field, text:
                    case ast.AnnAssign(ast.Name(name)), ast.Expr(ast.Constant(str(words))):
                        texts[name] = inspect.cleandoc(words)
    described = {name: field.description for name, field in section.model_fields.items()}
    return texts | {name: text for name, text in described.items() if text}


def _section(section: Section, values: Mapping[str, Any], indent: str) -> Iterator[str]:
    texts = explanations(type(section))
    for name, info in type(section).model_fields.items():
        value = getattr(section, name)
        if name == "size" and isinstance(section, Shape) and name not in values:
            continue
        if not indent:
            yield ""
        if isinstance(value, Section):
            yield from _comment(_first_line(type(value)), indent)
            yield f"{indent}{name}:"
            yield from _section(value, values[name], indent + "  ")
            continue
        for paragraph in texts.get(name, "").split("\n\n"):
            yield from _comment(paragraph, indent)
        yield from _item_keys(info, indent)
        plain = values.get(name)
        style, width = None if isinstance(plain, list) else False, WIDTH - len(indent)
        text = yaml.safe_dump({name: plain}, default_flow_style=style, sort_keys=False, width=width)
        yield from textwrap.indent(text, indent).splitlines()


def _item_keys(field: FieldInfo, indent: str) -> Iterator[str]:
    """Yield comments on the keys of the sections in a list, or of a section that may be null."""
    for item in get_args(field.annotation):
        if not (isclass(item) and issubclass(item, Section)):
            continue
        subject = "Each item" if get_origin(field.annotation) is tuple else "It"
        title = _first_line(item)
        yield from _comment(f"{subject} is {title[:1].lower()}{title[1:]}", indent)
        texts = explanations(item)
        for name in item.model_fields:
            if name == "size" and issubclass(item, Shape):
                continue  # explained at camera.size
            yield from textwrap.wrap(
                f"{name}: {texts.get(name, '')}",
                WIDTH,
                initial_indent=f"{indent}#   ",
                subsequent_indent=f"{indent}#     ",
            )


def _first_line(section: type[Section]) -> str:
    return (section.__doc__ or "").partition("\n")[0]


def _comment(text: str, indent: str) -> list[str]:
    prefix = f"{indent}# "
    return textwrap.wrap(text, WIDTH, initial_indent=prefix, subsequent_indent=prefix)
