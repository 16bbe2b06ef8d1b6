"""YAML text → plain values, each with its place in the text, so that errors can name it."""

import re
import reprlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import TypeAdapter, ValidationError

from vdet.errors import ConfigError, printable
from vdet.files import read_whole

MAX_BYTES = 100_000
"""Ten times the size of all settings with all their comments."""
MAX_INTEGER_BITS = 64
MAX_MISTAKES = 20
"""Maximum number of mistakes of one file that are shown; the others are counted."""

T = TypeVar("T")

Key = tuple[str | int, ...]
"""Path to a value from the root: `("search", "windows", 0, "size")`."""


@dataclass(frozen=True, slots=True)
class Document:
    """Values read from the source `name`, and the place of each key: `file:line:column`."""

    name: str
    values: dict[str, Any]
    places: dict[Key, str] = field(default_factory=dict)

    def place_of(self, key: Key) -> str:
        """Return the place of a key, or of the nearest thing in or around it that has one."""
        for length in range(len(key), -1, -1):
            for at, place in self.places.items():
                if at[:length] == key[:length]:
                    return place
        return self.name


def format_key(key: Key) -> str:
    """Write a path as a user would: `detector.search.windows[0].size`."""
    text = ""
    for part in key:
        name = printable(str(part))
        text += f"[{name}]" if isinstance(part, int) else f".{name}" if text else name
    return text


def config_error(lines: Iterable[str], count: int) -> ConfigError:
    """Return the error for `count` mistakes; only the first of their `lines` are shown."""
    shown = list(islice(lines, MAX_MISTAKES))
    if count > len(shown):
        shown.append(f"… and {count - len(shown)} more mistakes")
    return ConfigError(*shown)


class _Loader(yaml.SafeLoader):
    """Safe YAML in which `1e-3` is a number, and aliases and tags are refused.

    In YAML 1.1 a number with an exponent needs a dot and a sign: `1.0e-3`. A few aliases can expand
    to billions of values, a tag can ask for any kind of value; settings need neither.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if self.check_event(yaml.AliasEvent):
            refused = "aliases (*name)"
        elif getattr(event, "tag", None):
            refused = "tags (!name)"
        else:
            return super().compose_node(parent, index)
        problem = f"{refused} are not accepted"
        raise yaml.composer.ComposerError(None, None, problem, event.start_mark)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+0123456789."),
)


def read_document(path: Path) -> Document:
    """Read a YAML file of settings.

    Raises
    ------
    ConfigError
        The file cannot be read, is not YAML, or gives a key twice.
    """
    data = read_whole(path, most=MAX_BYTES, what="settings file", error=ConfigError)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text; that unknown settings file") from error
    return parse_document(text, str(path))


def read_values(path: Path, kind: type[T], mistakes: Mapping[str, str]) -> T:
    """Read a YAML file as a value of a class that pydantic checks.

    `mistakes` are messages by pydantic's type of the mistake.

    Raises
    ------
    ConfigError
        As of `read_document`; or the values are wrong, with one line for each mistake.
    """
    document = read_document(path)
    try:
        return TypeAdapter(kind).validate_python(document.values)
    except ValidationError as error:
        lines = []
        for detail in error.errors():
            key = tuple(detail["loc"])
            said = detail["msg"].removeprefix("Value error, ").removeprefix("Input ")
            named = f"{format_key(key)}: " if key else ""
            text = mistakes.get(detail["type"], said)
            lines.append(f"{document.place_of(key)}: {named}{text}")
        raise config_error(lines, len(lines)) from error


def parse_document(text: str, name: str) -> Document:
    """Read YAML text; `name` is its name in messages. Raises `ConfigError`."""
    places: dict[Key, str] = {}
    values = _Reader(name, places).value(_compose(text, name), ())
    if not isinstance(values, dict | None):
        got = reprlib.repr(values)
        raise ConfigError(f"{name}:1:1: expected settings (key: value), got {got}")
    return Document(name, values or {}, places)


def parse_assignment(text: str) -> Document:
    """Read `key.key=value` as `--set` takes it.

    Raises
    ------
    ConfigError
        There is no `=`, a part of the key is missing, or the value is not YAML.
    """
    key, equals, value = text.partition("=")
    path: Key = tuple(key.strip().split("."))
    if not equals or not all(path):
        raise ConfigError(f"--set {text}: expected KEY=VALUE, as in output.crf=18")
    name, places = "--set", dict[Key, str]()
    nested = _Reader(name, places).value(_compose(value, name), path)
    for part in reversed(path):
        nested = {part: nested}
    return Document(name, nested, dict.fromkeys([*places, path], name))


def _compose(text: str, name: str) -> yaml.Node | None:
    try:
        return yaml.compose(text, _Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{name}:{mark.line + 1}:{mark.column + 1}" if mark else name
        raise ConfigError(f"{place}: is not YAML: {error.problem or error.context}") from error
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # a character that YAML refuses
        raise ConfigError(f"{name}: is not YAML: {' '.join(str(error).split())}") from error
    except RecursionError as error:
        raise ConfigError(f"{name}: is nested too deeply") from error


@dataclass(frozen=True, slots=True)
class _Reader:
    """Turns nodes into values, and adds their places to `places`. Raises `ConfigError`."""

    name: str
    places: dict[Key, str]

    def value(self, node: yaml.Node | None, key: Key) -> Any:
        if node is None:
            return None
        self.places.setdefault(key, self._place(node))
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, key)
        if isinstance(node, yaml.SequenceNode):
            return [self.value(item, (*key, i)) for i, item in enumerate(node.value)]
        return self._scalar(node)

    def _mapping(self, node: yaml.MappingNode, key: Key) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for name_node, value_node in node.value:
            place = self._place(name_node)
            if not isinstance(name_node, yaml.ScalarNode):
                raise ConfigError(f"{place}: expected a key, got a {name_node.id}")
            name = name_node.value
            if name in values:
                raise ConfigError(f"{place}: {printable(name)}: appears twice; remove one")
            self.places[(*key, name)] = place
            values[name] = self.value(value_node, (*key, name))
        return values

    def _scalar(self, node: yaml.Node) -> Any:
        try:
            value = yaml.constructor.SafeConstructor().construct_object(node)
            if isinstance(value, int) and value.bit_length() > MAX_INTEGER_BITS:
                raise OverflowError("the number is too large")
        except (yaml.YAMLError, ValueError, OverflowError) as error:
            problem = getattr(error, "problem", None) or error
            raise ConfigError(f"{self._place(node)}: cannot be understood: {problem}") from error
        return value

    def _place(self, node: yaml.Node) -> str:
        return f"{self.name}:{node.start_mark.line + 1}:{node.start_mark.column + 1}"
