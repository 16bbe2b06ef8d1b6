"""Elements of XML labels, read with limits against hostile files."""

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.parsers import expat

from vdet.errors import TruthError
from vdet.labels.label import Size, line_error
from vdet.labels.parsing import MAX_PART, parse_whole

MAX_DEPTH = 32
"""Largest number of nested XML elements; label files have 5."""

MAX_NAMES = 1000
"""Largest number of different names of elements and attributes; label files have 50."""

MAX_ELEMENTS = 3_000_000
"""Largest number of elements; a file of `MAX_BYTES` has fewer."""


def read_elements(
    path: Path, data: bytes, root: str, depth: int
) -> Iterator[tuple[ET.Element, ET.Element]]:
    """Yield each element of the XML file `path` with the one around it, when it ends.

    Those at most `depth` below the root are yielded; what is within one is complete. They are then
    removed, so that little of the file is in memory.

    Raises
    ------
    TruthError
        The XML is broken, declares a document type and could so expand into a large one, has
        another root, or is beyond a limit: of depth, of names, of elements, or of the length of a
        tag.
    """
    opened: list[ET.Element] = []
    try:
        for event, element in _events(data):
            if event == "start":
                opened.append(element)
                if len(opened) > MAX_DEPTH:
                    raise ValueError(f"has more than {MAX_DEPTH} nested elements")
                if opened[0].tag != root:
                    raise ValueError(f"<{element.tag:.40}> where the format has <{root}>")
            elif 0 < len(opened[:-1]) <= depth:
                yield opened[-2], element
                opened[-2].remove(opened.pop())
            else:
                opened.pop()
    except ET.ParseError as error:
        what = f"broken XML: {expat.ErrorString(error.code)}"
        raise line_error(path, error.position[0], what) from error
    except ValueError as error:
        raise TruthError(f"{path}: {error}") from error


def _events(data: bytes) -> Iterator[tuple[str, ET.Element]]:
    """Yield "start" and "end" of each element, parsed part by part. Raises ValueError."""
    if b"<!DOCTYPE" in data:
        raise ValueError("the XML declares a document type, which labels do not need; remove it")
    if b"\0" in data:  # as in UTF-16
        raise ValueError("is not text (UTF-8)")
    parser = ET.XMLPullParser(("start", "end"))
    names: set[str] = set()
    count = 0
    for start in range(0, len(data) + MAX_PART, MAX_PART):
        part = data[start : start + MAX_PART]
        if len(part) == MAX_PART and b"<" not in part:
            raise ValueError(f"an XML tag or text is longer than {MAX_PART:,} bytes")
        if part:
            parser.feed(part)
        else:
            parser.close()
        for event, element in parser.read_events():
            names.update((element.tag, *element.attrib))
            count += 1
            if len(names) > MAX_NAMES or count > 2 * MAX_ELEMENTS:
                raise ValueError(f"has more than {MAX_NAMES:,} names or {MAX_ELEMENTS:,} elements")
            yield event, element


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
