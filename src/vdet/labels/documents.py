"""JSON and XML documents: read as a whole if they take little memory, or lists entry by entry."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree import ElementTree as ET
from xml.parsers import expat

import ijson

from vdet.errors import TruthError, printable
from vdet.labels.label import Size, line_error
from vdet.labels.parsing import parse_whole

MAX_MEMORY = 700_000_000
"""Bytes that the values of a document may take, estimated, beside its text."""

MAX_ENTRY = 16_000_000
"""Largest number of bytes of an entry of a list that is read entry by entry."""

_CHUNK = 8192  # bytes
_NESTING = {b"[": 1, b"{": 1, b"]": -1, b"}": -1}
_MAX_DEPTH = 1000

MAX_NAMES = 1000
"""Largest number of different names in a document, each of which takes ten times its text."""

_JSON_SIZES = {b"{": 240, b"[": 64, b",": 64, b'\\"': 250}
"""Bytes that an object, a list, or a value in one take; a quote in a key would hide it."""
_JSON_NAME = re.compile(rb'"([^"]{0,1000}+)"\s*+:')
_XML_SIZES = {b"<": 100, b"=": 130}
"""Bytes that an element takes, half of them at its end, and an attribute."""
_XML_NAME = re.compile(rb"<([^\s/<>]{1,1000}+)|(?<=\s)([^\s\"'=<>]{1,1000}+)\s*+=")


def read_json(path: Path, data: bytes) -> Any:
    """Return the values of a JSON document.

    Raises
    ------
    TruthError
        It is not JSON, takes more than `MAX_MEMORY`, or has more than `MAX_NAMES` different keys.
    """
    _check_memory(path, data, _JSON_SIZES, _JSON_NAME)
    try:
        return json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise TruthError(f"{path}: is not JSON: {error}") from error


def json_entries(path: Path, file: BinaryIO, *lists: str) -> Iterator[tuple[str, Any]]:
    """Yield the entries of some lists in the object that a JSON document is, with their list.

    The lists are named as in `info.names`. Memory holds a few entries at a time.

    Raises
    ------
    TruthError
        It is not JSON, is nested too deeply, or has an entry of more than `MAX_ENTRY` bytes.
    """
    found = {name: ijson.sendable_list() for name in lists}
    readers = [
        ijson.items_coro(entries, f"{name}.item", use_float=True) for name, entries in found.items()
    ]
    size = depth = 0
    try:
        while chunk := file.read(_CHUNK):
            size += len(chunk)
            depth += sum(chunk.count(part) * step for part, step in _NESTING.items())
            _check_entry(path, size, depth)
            for reader in readers:
                reader.send(chunk)
            for name, entries in found.items():
                size = 0 if entries else size
                yield from ((name, entry) for entry in entries)
                entries.clear()
        for reader in readers:
            reader.close()
    except TruthError:
        raise
    except (ijson.JSONError, ValueError) as error:
        what = printable(str(error).partition("\n")[0].strip())
        raise TruthError(f"{path}: is not JSON: {what}") from error


def _check_entry(path: Path, size: int, depth: int) -> None:
    if depth > _MAX_DEPTH:  # each level takes the memory of all above it
        raise TruthError(f"{path}: is not JSON: nested too deeply")
    if size > MAX_ENTRY:
        raise TruthError(f"{path}: has an entry of more than {MAX_ENTRY:,} bytes")


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
    _check_memory(path, data, _XML_SIZES, _XML_NAME)
    try:
        document = ET.fromstring(data, ET.XMLParser(encoding="utf-8"))
    except ET.ParseError as error:
        what = f"broken XML: {expat.ErrorString(error.code)}"
        raise line_error(path, error.position[0], what) from error
    if document.tag != root:
        raise TruthError(f"{path}: <{document.tag:.40}> where the format has <{root}>")
    return document


def _check_memory(
    path: Path, data: bytes, sizes: Mapping[bytes, int], name: re.Pattern[bytes]
) -> None:
    """Refuse a document whose values would take too much memory, before it is parsed."""
    text = 0 if data.isascii() else 4 * len(data)  # one wide character makes all of them wide
    if text + sum(data.count(part) * size for part, size in sizes.items()) > MAX_MEMORY:
        raise TruthError(f"{path}: would take more than 1 GB of memory; cut it into parts")
    names: set[bytes] = set()
    for found in name.finditer(data):
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
    width, height = (parse_whole(text_of(element, name)) for name in ("width", "height"))
    return (width, height) if min(width, height) > 0 else None
