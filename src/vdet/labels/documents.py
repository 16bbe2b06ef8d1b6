"""JSON and XML documents: JSON is read value by value, XML as a whole if it takes little memory."""

import math
import re
from collections.abc import Iterator
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

_CHUNK = 8192  # bytes
_NESTING = {b"[": 1, b"{": 1, b"]": -1, b"}": -1}
_MAX_DEPTH = 1000

_SIZES = {b"<": 100, b"=": 130}
"""Bytes that an element takes, half of them at its end, and an attribute."""
_NAME = re.compile(rb"<([^\s/<>]{1,1000}+)|(?<=\s)([^\s\"'=<>]{1,1000}+)\s*+=")


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
    found = {place: ijson.sendable_list() for place in places}
    readers = {
        place: ijson.items_coro(values, place, use_float=True) for place, values in found.items()
    }
    size = 0
    for chunk in _chunks(path, file, most):
        size += len(chunk)
        if size > MAX_ENTRY:
            raise TruthError(f"{path}: has an entry of more than {MAX_ENTRY:,} bytes")
        with _json_errors(path):
            for reader in readers.values():
                reader.send(chunk)
        for place, values in found.items():
            size = 0 if values else size
            yield from ((place, value) for value in values)
            if values and not place.endswith(".item"):
                del readers[place]  # each takes the time of a whole one
            values.clear()
    with _json_errors(path):
        for reader in readers.values():
            reader.close()


def _chunks(path: Path, file: IO[bytes], most: float) -> Iterator[bytes]:
    total = depth = 0
    while chunk := file.read(_CHUNK):
        total += len(chunk)
        depth += sum(chunk.count(part) * step for part, step in _NESTING.items())
        if total > most:
            raise TruthError(f"{path}: is larger than {most:,} bytes; cut it into parts")
        if depth > _MAX_DEPTH:  # each level takes the memory of all above it
            raise TruthError(f"{path}: is not JSON: nested too deeply")
        yield chunk


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
    text = 0 if data.isascii() else 4 * len(data)  # one wide character makes all of them wide
    if text + sum(data.count(part) * size for part, size in _SIZES.items()) > MAX_MEMORY:
        raise TruthError(f"{path}: would take more than 1 GB of memory; cut it into parts")
    names: set[bytes] = set()
    for found in _NAME.finditer(data):
        names.add(found[found.lastindex or 0])
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
