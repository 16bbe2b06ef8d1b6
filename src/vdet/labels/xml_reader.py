"""A reader of XML labels with limits against hostile files."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from vdet.labels.label import line_error
from vdet.labels.parsing import parse_whole

MAX_DEPTH = 32
"""Largest number of nested XML elements; label files have 5."""

_MAX_TEXT = 1000  # characters


@dataclass(slots=True)
class Element:
    """An open element; its `text` is complete when it ends.

    `values` are the texts of the elements that have ended in it, by their names.
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


def read_xml(path: Path, text: str, root: str, take: Callable[[list[Element]], None]) -> None:
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
        The XML is broken, declares a document type, is nested deeper than `MAX_DEPTH`, has another
        root, or `take` has raised a ValueError.
    """
    if "<!DOCTYPE" in text:
        line = text.count("\n", 0, text.index("<!DOCTYPE")) + 1
        what = "the XML declares a document type, which labels do not need; remove it"
        raise line_error(path, line, what)
    parser = _parser(root, take)
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        what = f"broken XML: {expat.ErrorString(error.code)}"
        raise line_error(path, error.lineno, what) from error
    except ValueError as error:
        raise line_error(path, parser.CurrentLineNumber, str(error)) from error


def _parser(root: str, take: Callable[[list[Element]], None]) -> expat.XMLParserType:
    parser = expat.ParserCreate()
    opened: list[Element] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        if not opened and name != root:
            raise ValueError(f"<{name:.40}> where the format has <{root}>")
        if len(opened) == MAX_DEPTH:
            raise ValueError(f"more than {MAX_DEPTH} nested elements")
        opened.append(Element(name, attributes, parser.CurrentLineNumber))

    def add_text(part: str) -> None:
        opened[-1].text += part[: _MAX_TEXT - len(opened[-1].text)]

    def end(_: str) -> None:
        take(opened)
        element = opened.pop()
        if opened:
            opened[-1].values.setdefault(element.name, []).append(element.text)

    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = add_text
    return parser
