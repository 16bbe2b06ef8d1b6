"""XML files of labels, read without what a file from a stranger could do harm with."""

from pathlib import Path
from xml.parsers import expat

from vdet.labels.rows import line_error

MAX_DEPTH = 32
"""Most nested XML elements; label files have 5."""


class XmlReader:
    """Reads an XML file from its beginning to its end; a subclass takes what it needs.

    Document types, and with them entities, are refused, so that a small file cannot expand into a
    large one. A method may raise a ValueError that says what is wrong.

    Attributes
    ----------
    open
        The names of the elements that are open, from the root on.
    """

    def __init__(self) -> None:
        self.open: list[str] = []
        self._parser = expat.ParserCreate()
        self._parser.buffer_text = True
        self._parser.StartDoctypeDeclHandler = self._refuse_doctype
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self.text

    @property
    def line(self) -> int:
        """The line that is read, from 1."""
        return self._parser.CurrentLineNumber

    def read(self, path: Path, text: str) -> None:
        """Read the text of the file `path`.

        Raises
        ------
        TruthError
            The XML is broken, declares a document type, is nested deeper than `MAX_DEPTH`, or a
            method has raised a ValueError.
        """
        try:
            self._parser.Parse(text, True)
        except expat.ExpatError as error:
            what = f"broken XML: {expat.ErrorString(error.code)}"
            raise line_error(path, error.lineno, what) from error
        except ValueError as error:
            raise line_error(path, self.line, str(error)) from error

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Take the start of an element, which is the last of `open`."""

    def end(self) -> None:
        """Take the end of the last element of `open`."""

    def text(self, text: str) -> None:
        """Take text in the last element of `open`; it may come in parts."""

    def _refuse_doctype(self, *_: object) -> None:
        raise ValueError("the XML declares a document type, which labels do not need; remove it")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        if len(self.open) == MAX_DEPTH:
            raise ValueError(f"more than {MAX_DEPTH} nested elements")
        self.open.append(name)
        self.start(name, attributes)

    def _end(self, _: str) -> None:
        self.end()
        self.open.pop()


def attribute(element: str, attributes: dict[str, str], name: str) -> str:
    """Return an attribute of an element; raises ValueError where it has none of that name."""
    if name not in attributes:
        raise ValueError(f"<{element}> without its '{name}'")
    return attributes[name]
