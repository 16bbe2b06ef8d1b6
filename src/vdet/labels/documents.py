"""JSON and XML documents: JSON is read value by value, XML as a whole if it takes little memory."""

import math
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any
from xml.etree import ElementTree as ET
from xml.parsers import expat

import ijson

from vdet.errors import TruthError, printable
from vdet.labels.label import Size, known_size, line_error
from vdet.labels.parsing import parse_whole

MAX_MEMORY = 700_000_000
"""Bytes that the elements of an XML document may take, estimated, beside its text."""

MAX_NAMES = 1000
"""Largest number of different names in it, each of which takes ten times its text."""

MAX_ENTRY = 16_000_000
"""Largest number of bytes between two values that are read from a JSON document."""

_CHUNK = 65_536  # bytes; a text that goes on in the next chunk is read again from its start
_MAX_DEPTH = 1000
_STARTS: dict[str, Callable[[], Any]] = {"start_map": dict, "start_array": list}
_ENDS = ("end_map", "end_array")

_SIZES = {b"<": 100, b"=": 130}
"""Bytes that an element takes, half of them at its end, and an attribute."""
_ELEMENT = re.compile(rb"<([^\s/<>]{1,1000}+)")
_EMAN = re.compile(rb"=\s*+([^\s\"'=<>]{1,1000}+)(?=\s)")
"""The name of an attribute in a reversed text, whose "=" is found at once."""


def json_values(
    path: Path, file: IO[bytes], *places: str, most: float = math.inf
) -> Iterator[tuple[str, Any]]:
    """Yield the values at some places of a JSON document, each with its place.

    Places are those of ijson: `metadata.video` is one value, `images.item` each entry of a list.
    Memory holds a few values at a time.

    Raises
    ------
    TruthError
        It is not JSON, is nested too deeply, has more than `MAX_ENTRY` bytes without such a value,
        or more than `most` in all.
    """
    events, finder, total, size = ijson.sendable_list(), _Finder(places), 0, 0
    parser = ijson.basic_parse_coro(events, use_float=True)
    while chunk := file.read(_CHUNK):
        total, size = total + len(chunk), size + len(chunk)
        if total > most:
            raise TruthError(f"{path}: is larger than {most:,} bytes; cut it into parts")
        if size > MAX_ENTRY:
            raise TruthError(f"{path}: has an entry of more than {MAX_ENTRY:,} bytes")
        with _json_errors(path):
            parser.send(chunk)
            values = list(finder.values(events))
        events.clear()
        size = 0 if values else size
        yield from values
    with _json_errors(path):
        parser.close()


class _Finder:
    """Builds the values at some places of a JSON document from its events."""

    def __init__(self, places: Iterable[str]) -> None:
        self._places = {tuple(place.split(".")): place for place in places}
        self._deepest = max(map(len, self._places))
        self._keys: list[str] = []  # of each open map the last key, of each open list "item"
        self._parts: list[Any] = []  # the open maps and lists of the value that is built

    def values(self, events: Iterable[tuple[str, Any]]) -> Iterator[tuple[str, Any]]:
        """Yield each value that some further events complete, with its place.

        Raises `ValueError` where the document is nested too deeply.
        """
        keys, parts = self._keys, self._parts
        for event, value in events:
            if event == "map_key":
                keys[-1] = value
            elif event in _STARTS:
                self._open(event)
            elif event in _ENDS:
                keys.pop()
                part = parts.pop() if parts else None
                if part is not None and not parts:
                    yield self._places[(*keys,)], part
            elif parts:
                self._add(value)
            elif self._is_wanted():
                yield self._places[(*keys,)], value

    def _is_wanted(self) -> bool:
        return len(self._keys) <= self._deepest and (*self._keys,) in self._places

    def _open(self, event: str) -> None:
        value = _STARTS[event]()
        if self._parts:
            self._add(value)
        if self._parts or self._is_wanted():
            self._parts.append(value)
        self._keys.append("item" if event == "start_array" else "")
        if len(self._keys) > _MAX_DEPTH:
            raise ValueError("nested too deeply")

    def _add(self, value: Any) -> None:
        parent = self._parts[-1]
        if isinstance(parent, list):
            parent.append(value)
        else:
            parent[self._keys[-1]] = value


@contextmanager
def _json_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except (ijson.JSONError, ValueError) as error:
        what = printable(str(error).partition("\n")[0].strip())
        raise TruthError(f"{path}: is not JSON: {what}") from error


def read_xml(path: Path, data: bytes, root: str) -> ET.Element:
    """Return the first element of an XML document, which must be a `root`.

    Raises
    ------
    TruthError
        The XML is broken, declares a document type and could so expand into a large one, has
        another root, takes more than `MAX_MEMORY`, or has more than `MAX_NAMES`.
    """
    if b"\0" in data:  # as in UTF-16, in which a document type would not be found
        raise TruthError(f"{path}: is not text (UTF-8)")
    if b"<!DOCTYPE" in data:
        what = "the XML declares a document type, which labels do not need; remove it"
        raise TruthError(f"{path}: {what}")
    _check_memory(path, data)
    try:
        document = ET.fromstring(data, ET.XMLParser(encoding="utf-8"))
    except ET.ParseError as error:
        what = f"broken XML: {expat.ErrorString(error.code)}"
        raise line_error(path, error.position[0], what) from error
    if document.tag != root:
        raise TruthError(f"{path}: <{document.tag:.40}> where the format has <{root}>")
    return document


def _check_memory(path: Path, data: bytes) -> None:
    """Refuse a document whose elements would take too much memory, before it is parsed."""
    wide = 0 if data.isascii() else 4 * len(data)  # one wide character makes all of them wide
    if wide + sum(data.count(part) * size for part, size in _SIZES.items()) > MAX_MEMORY:
        raise TruthError(f"{path}: would take more than 1 GB of memory; cut it into parts")
    for text, pattern in ((data, _ELEMENT), (data[::-1], _EMAN)):
        names: set[bytes] = set()
        for found in pattern.finditer(text):
            names.add(found[1])
            if len(names) > MAX_NAMES:
                raise TruthError(f"{path}: has more than {MAX_NAMES:,} different names of values")


def attribute(element: ET.Element, name: str) -> str:
    """Return an attribute. Raises ValueError where it is missing."""
    value = element.get(name)
    if value is None:
        raise ValueError(f"<{element.tag:.40}> without its '{name}'")
    return value


def text_of(element: ET.Element, name: str) -> str:
    """Return the text of an element in another. Raises ValueError where it is missing."""
    text = element.findtext(name)
    if text is None:
        raise ValueError(f"<{element.tag:.40}> without its <{name}>")
    return text.strip()


def size_of(element: ET.Element | None) -> Size | None:
    """Return `width` and `height` in an element; None without it, or for 0, as some tools write."""
    if element is None:
        return None
    return known_size(*(parse_whole(text_of(element, name)) for name in ("width", "height")))
