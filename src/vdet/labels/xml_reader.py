"""A reader of XML labels with limits against hostile files."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from vdet.labels.label import MAX_LABELS, line_error
from vdet.labels.parsing import check_parts, parse_whole

MAX_DEPTH = 32
"""Largest number of nested XML elements; label files have 5."""

MAX_NAMES = 1000
"""Largest number of different names of elements and attributes; label files have 50."""

_MAX_TEXT = 1000  # characters


@dataclass(slots=True)
class Element:
    """An open element; its `text` is complete when it ends.

    `values` are the texts of the elements that have ended in it, by their names, two of each name.
    """

    name: str
    attributes: dict[str, str]
    line: int
    text: str = ""
    values: dict[str, list[str]] = field(default_factory=dict)

    def attribute(self, name: str) -> str:
        """Return an attribute. Raises ValueError where there is none of that name."""
        if name not in self.attributes:
            raise ValueError(f"<{self.name:.40}> without its '{name}'")
        return self.attributes[name]

    @property
    def size(self) -> tuple[int, int] | None:
        """The whole numbers in `width` and `height`; None if one is 0, as some tools write."""
        width, height = (parse_whole(self.value(name)) for name in ("width", "height"))
        return (width, height) if min(width, height) > 0 else None

    def value(self, name: str) -> str:
        """Return the text of an element in it. Raises ValueError where there is not exactly one."""
        texts = self.values.get(name, [])
        if not texts:
            raise ValueError(f"<{self.name:.40}> without its <{name}>")
        if len(texts) > 1:
            raise ValueError(f"<{name}> is given twice")
        return texts[0].strip()


def read_xml(path: Path, data: bytes, root: str, take: Callable[[list[Element]], None]) -> None:
    """Read the XML of the file `path`.

    Document types, and with them entities, are refused, so that a small file cannot expand into a
    large one.

    Parameters
    ----------
    root
        Name of the first element.
    take
        Function that gets the open elements, from the root on, whenever the last of them ends. Its
        ValueError becomes the message.

    Raises
    ------
    TruthError
        The XML is broken, declares a document type, has another root, or is beyond a limit: of
        depth, of names, of elements, or of the length of a tag. Or `take` has raised a ValueError.
    """
    check_parts(path, data, "an XML tag or text", (b"<",))
    reader = _Reader(root, take)
    try:
        reader.parser.Parse(data, True)
    except expat.ExpatError as error:
        what = f"broken XML: {expat.ErrorString(error.code)}"
        raise line_error(path, error.lineno, what) from error
    except ValueError as error:
        raise line_error(path, reader.parser.CurrentLineNumber, str(error)) from error


class _Reader:
    """What happens at each tag, and at each text."""

    def __init__(self, root: str, take: Callable[[list[Element]], None]) -> None:
        self._names: dict[str, str] = {}  # of all elements and attributes
        self._opened: list[Element] = []
        self._root, self._take, self._count = root, take, 0
        self.parser = expat.ParserCreate("utf-8", intern=self._names)
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._add_text
        self.parser.StartDoctypeDeclHandler = self._refuse_type

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if not self._opened and name != self._root:
            raise ValueError(f"<{name:.40}> where the format has <{self._root}>")
        if len(self._opened) == MAX_DEPTH:
            raise ValueError(f"more than {MAX_DEPTH} nested elements")
        if len(self._names) > MAX_NAMES or self._count > MAX_LABELS:
            raise ValueError(f"more than {MAX_NAMES:,} names or {MAX_LABELS:,} elements")
        self._opened.append(Element(name, attributes, self.parser.CurrentLineNumber))

    def _add_text(self, part: str) -> None:
        element = self._opened[-1]
        element.text += part[: _MAX_TEXT - len(element.text)]

    def _end(self, _: str) -> None:
        self._take(self._opened)
        element = self._opened.pop()
        if self._opened and len(texts := self._opened[-1].values.setdefault(element.name, [])) < 2:
            texts.append(element.text)

    def _refuse_type(self, *_: object) -> None:
        raise ValueError("the XML declares a document type, which labels do not need; remove it")
