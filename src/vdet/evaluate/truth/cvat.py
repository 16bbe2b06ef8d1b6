"""CVAT for video 1.1: XML with a track for every vehicle; frames and pixels count from 0.

Source: the CVAT manual, "XML annotation format", section "Interpolation".
"""

from pathlib import Path
from xml.parsers import expat

from vdet.evaluate.rows import Row, refusal
from vdet.evaluate.text import number, whole
from vdet.evaluate.truth.labels import Role, role_of

MAX_DEPTH = 32
"""Of elements in one another; the format has 4."""

_Attributes = dict[str, str]


def cvat_rows(path: Path, text: str) -> list[Row]:
    """Return the boxes of the tracks that are not `outside`; those `occluded` count.

    The labels are read by `vdet.evaluate.truth.labels`. Document types and with them entities
    are refused, so that a small file cannot unfold into a large one.

    Raises
    ------
    TruthError
        The XML is broken, declares a document type, is nested deeper than `MAX_DEPTH`, or is not
        of this kind.
    """
    reader = _Reader()
    try:
        reader.parser.Parse(text, True)
    except expat.ExpatError as error:
        what = f"broken XML: {expat.ErrorString(error.code)}"
        raise refusal(path, error.lineno, what) from error
    except ValueError as error:
        raise refusal(path, reader.parser.CurrentLineNumber, str(error)) from error
    return reader.rows


class _Reader:
    """Gathers rows while expat goes through the text; a ValueError says what is wrong."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.parser = expat.ParserCreate()
        self.parser.StartDoctypeDeclHandler = self._refuse_doctype
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self._open: list[str] = []
        self._track = 0
        self._role = Role.OTHER

    def _refuse_doctype(self, *_: object) -> None:
        raise ValueError("the XML declares a document type, which truth has no use for; remove it")

    def _start(self, name: str, attributes: _Attributes) -> None:
        if len(self._open) == MAX_DEPTH:
            raise ValueError(f"more than {MAX_DEPTH} elements in one another")
        self._open.append(name)
        match self._open:
            case ["annotations", "track"]:
                self._track = whole(_get(name, attributes, "id"))
                self._role = role_of(_get(name, attributes, "label"))
            case ["annotations", "track", "box"]:
                self._box(attributes)
            case ["annotations", "track", _]:
                raise ValueError(f"<{name:.40}> in a track; only boxes can be scored")
            case ["annotations", "image"]:
                raise ValueError("CVAT for images; export the task as 'CVAT for video 1.1'")
            case [root] if root != "annotations":
                raise ValueError(f"<{name:.40}> where CVAT for video 1.1 has <annotations>")

    def _end(self, _: str) -> None:
        self._open.pop()

    def _box(self, attributes: _Attributes) -> None:
        if number(attributes.get("rotation", "0")):
            raise ValueError("the box is rotated; only upright boxes can be scored")
        frame = whole(_get("box", attributes, "frame"))
        left, top, right, bottom = (
            number(_get("box", attributes, side)) for side in ("xtl", "ytl", "xbr", "ybr")
        )
        if self._role is Role.OTHER or whole(_get("box", attributes, "outside")):
            return
        place = frame + 1, self._track, left, top, right - left, bottom - top
        ignored = self._role is Role.IGNORED
        self.rows.append(Row(self.parser.CurrentLineNumber, *place, ignored=ignored))


def _get(element: str, attributes: _Attributes, name: str) -> str:
    if name not in attributes:
        raise ValueError(f"<{element}> without its '{name}'")
    return attributes[name]
