"""Labels in Pascal VOC form: `JPEGImages`, and `Annotations` with an XML file for each."""

from collections.abc import Iterator
from pathlib import Path

from vdet.labels.parsing import parse_number, parse_whole, read_text
from vdet.labels.pictures.folders import labelled_pairs
from vdet.labels.pictures.labelled import ImageLabels, Label
from vdet.labels.xml_reader import XmlReader

_CORNERS = ("xmin", "ymin", "xmax", "ymax")
_VALUES = {"name", "difficult", "width", "height", *_CORNERS}
_MAX_TEXT = 1000  # characters


def voc_labels(folder: Path) -> Iterator[ImageLabels]:
    """Yield every picture that has a file in `Annotations`.

    Pixels count from 1, and the last row and column belong to the box. An object that is
    `difficult` is an ignore region, as in the VOC challenge.
    Source: Everingham et al., "The Pascal Visual Object Classes (VOC) Challenge", 2010, and the
    readme of its development kit.

    Raises
    ------
    TruthError
        A file has no picture, is broken XML, declares a document type, or is of another form.
    """
    for file, picture in labelled_pairs(folder / "Annotations", ".xml", folder / "JPEGImages"):
        reader = _VocReader(file)
        reader.read(file, read_text(file))
        yield ImageLabels(picture, tuple(reader.labels), reader.size)


class _VocReader(XmlReader):
    """Collects the objects of one picture."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.labels: list[Label] = []
        self.size: tuple[int, int] | None = None
        self._path = path
        self._values: dict[str, str] = {}  # of the object, or of the size, that is open
        self._line = 0
        self._text = ""

    def start(self, name: str, attributes: dict[str, str]) -> None:  # noqa: ARG002 - VOC has none
        """Begin an object, the size, or a value in one."""
        if self.open[0] != "annotation":
            raise ValueError(f"<{name:.40}> where Pascal VOC has <annotation>")
        self._text = ""
        if self.open in (["annotation", "object"], ["annotation", "size"]):
            self._values, self._line = {}, self.line

    def text(self, text: str) -> None:
        """Take a part of a value."""
        self._text += text
        if len(self._text) > _MAX_TEXT:
            raise ValueError(f"a value has more than {_MAX_TEXT} characters")

    def end(self) -> None:
        """Take a value, an object or the size."""
        match self.open:
            case ["annotation", "object"]:
                self.labels.append(self._label())
            case ["annotation", "size"]:
                size = parse_whole(self._value("width")), parse_whole(self._value("height"))
                self.size = size if min(size) > 0 else None  # some tools write 0
            case ["annotation", "size", name] | ["annotation", "object", name]:
                self._take(name)
            case ["annotation", "object", "bndbox", name]:
                self._take(name)
        self._text = ""

    def _take(self, name: str) -> None:
        if name not in _VALUES:
            return
        if name in self._values:
            raise ValueError(f"<{name:.40}> is given twice")
        self._values[name] = self._text.strip()

    def _label(self) -> Label:
        left, top, right, bottom = (parse_number(self._value(name)) for name in _CORNERS)
        return Label(
            f"{self._path}:{self._line}",
            self._value("name"),
            left - 1,
            top - 1,
            right - left + 1,
            bottom - top + 1,
            ignored=parse_whole(self._values.get("difficult", "0")) == 1,
        )

    def _value(self, name: str) -> str:
        if name not in self._values:
            raise ValueError(f"<{self.open[-1]}> without its <{name}>")
        return self._values[name]
