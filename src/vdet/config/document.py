"""YAML text → plain values, each with its position in the text, so that errors can name it."""

import re
import reprlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

import yaml
from yaml.constructor import ConstructorError

from vdet.errors import ConfigError, printable
from vdet.files import read_whole

MAX_BYTES = 100_000
"""Ten times the size of all settings with all their comments."""

_WORDS = ("yes", "no", "on", "off")
_LEADING_ZERO = re.compile(r"[-+]?0+([0-9]+)")
_CANNOT_START = re.compile("found character '[%@`]' that cannot start any token")

Key = tuple[str | int, ...]
"""Path to a value from the root: `("search", "windows", 0, "size")`."""


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
