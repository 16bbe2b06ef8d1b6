"""JSON and XML documents: read as a whole if they take little memory, or lists entry by entry."""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree import ElementTree as ET
from xml.parsers import expat

from vdet.errors import TruthError
from vdet.labels.label import Size, line_error
from vdet.labels.parsing import parse_whole

MAX_MEMORY = 700_000_000
"""Bytes that the values of a document may take, estimated, beside its text."""

MAX_ENTRY = 4_000_000
"""Largest number of bytes of an entry of a list that is read entry by entry."""

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


def json_entries(path: Path, opened: Callable[[], BinaryIO], name: str) -> Iterator[Any]:
    """Yield the entries of a list in the object that a JSON document is; memory holds one of them.

    Raises
    ------
    TruthError
        It is not JSON, has no such list, or an entry is larger than `MAX_ENTRY`.
    """
    import ijson

    start = None
    try:
        with opened() as file:
            for prefix, event, _ in ijson.parse(file):
                if (prefix, event) == (name, "start_array"):
                    start = file.tell()
                    break
        if start is None:
            raise TruthError(f"{path}: is not COCO: the list {name} is missing")
        with opened() as file:
            limited = _LimitedEntries(file, start)
            for entry in ijson.items(limited, f"{name}.item", use_float=True):
                limited.begin = file.tell()
                yield entry
    except (ijson.JSONError, ValueError) as error:
        raise TruthError(f"{path}: {name}: invalid JSON: {error}") from error


class _LimitedEntries:
    """A file of which no more than an entry is read from `begin` on, until that is moved."""

    def __init__(self, file: BinaryIO, begin: int) -> None:
        self._file = file
        self.begin = begin

    def read(self, size: int) -> bytes:
        """Return the next bytes. Raises ValueError where an entry is too large."""
        if self._file.tell() > self.begin + MAX_ENTRY:
            raise ValueError(f"an entry is larger than {MAX_ENTRY:,} bytes")
        return self._file.read(size)


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
