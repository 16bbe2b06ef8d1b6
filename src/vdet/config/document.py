"""YAML text → plain values, each with its place in the text, so that errors can name it."""

import re
import reprlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from yaml.constructor import ConstructorError

from vdet.errors import ConfigError, printable
from vdet.files import read_whole

MAX_BYTES = 100_000
"""Ten times the size of all settings with all their comments."""
MAX_INTEGER_BITS = 64

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


class _Loader(yaml.SafeLoader):
    """Safe YAML with text as keys, each once, and without aliases and tags.

    A few aliases can expand to billions of values, a tag can ask for any kind of value; settings
    need neither.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if self.check_event(yaml.AliasEvent):
            refused = "aliases (*name)"
        elif getattr(event, "tag", None):
            refused = "tags (!name)"
        else:
            return super().compose_node(parent, index)
        raise ConstructorError(None, None, f"{refused} are not accepted", event.start_mark)

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            value = super().construct_object(node, deep)
            if isinstance(value, int) and value.bit_length() > MAX_INTEGER_BITS:
                raise OverflowError("the number is too large")
        except (ValueError, OverflowError) as error:
            raise ConstructorError(None, None, str(error), node.start_mark) from error
        return value

    def mapping(self, node: yaml.MappingNode) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for key, value in node.value:
            problem = None if isinstance(key, yaml.ScalarNode) else f"a {key.id} cannot be a key"
            if problem is None and key.value in values:
                problem = f"{printable(key.value)} appears twice; remove one"
            if problem:
                raise ConstructorError(None, None, problem, key.start_mark)
            values[key.value] = self.construct_object(value, deep=True)
        return values


_Loader.add_constructor("tag:yaml.org,2002:map", _Loader.mapping)
# In YAML 1.1 a number with an exponent needs a dot and a sign: `1.0e-3`.
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
        raise ConfigError(f"{path}: is not UTF-8 text; save it as UTF-8") from error
    return parse_document(text, str(path))


def parse_document(text: str, name: str) -> Document:
    """Read YAML text; `name` is its name in messages. Raises `ConfigError`."""
    values, places = _parse(text, name)
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
    nested, places = _parse(value, "--set")
    for part in reversed(path):
        nested = {part: nested}
    inside = ((*path, *key) for key in places or [()])
    return Document("--set", nested, dict.fromkeys(inside, "--set"))


def _parse(text: str, name: str) -> tuple[Any, dict[Key, str]]:
    """Return the value of YAML text, and the places of all keys in it. Raises `ConfigError`."""
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None, {}
        value = loader.construct_document(node)
        marks = dict(_marks(node, ()))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{name}:{mark.line + 1}:{mark.column + 1}" if mark else name
        raise ConfigError(f"{place}: is not YAML: {error.problem or error.context}") from error
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # a character that YAML refuses
        raise ConfigError(f"{name}: is not YAML: {' '.join(str(error).split())}") from error
    except RecursionError as error:
        raise ConfigError(f"{name}: is nested too deeply") from error
    return value, {key: f"{name}:{mark.line + 1}:{mark.column + 1}" for key, mark in marks.items()}


def _marks(node: yaml.Node, key: Key) -> Iterator[tuple[Key, yaml.Mark]]:
    """Yield where a value and everything in it stands; a named one stands where its name does."""
    yield key, node.start_mark
    if isinstance(node, yaml.MappingNode):
        for name, value in node.value:
            yield from _marks(value, (*key, name.value))
            yield (*key, name.value), name.start_mark
    elif isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            yield from _marks(item, (*key, index))
