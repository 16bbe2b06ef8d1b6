"""The truth of a video: MOTChallenge, KITTI tracking or CVAT files."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from vdet.errors import TruthError
from vdet.evaluate.labelled_video import LabelledVideo, Row, checked_video, line_error
from vdet.evaluate.labels import Role, role_of
from vdet.evaluate.mot import truth_rows
from vdet.evaluate.parsing import numbered_lines, parse_number, parse_whole, read_text
from vdet.evaluate.xml_reader import XmlReader, attribute

_FORMATS = "MOTChallenge gt.txt, KITTI tracking labels or CVAT for video 1.1"
_KITTI_COLUMNS = 17


def read_truth(path: Path, *, frame_count: int | None = None) -> LabelledVideo:
    """Read truth. The first line tells the format: XML, commas or spaces.

    Parameters
    ----------
    path
        A MOTChallenge `gt.txt`, KITTI tracking labels or CVAT for video 1.1.
    frame_count
        Number of frames of the video if known; boxes in later frames are refused.

    Raises
    ------
    TruthError
        The file cannot be read, is empty, or has a mistake; the message names the first one's line.
    """
    text = read_text(path)
    return checked_video(path, _reader(path, text)(path, text), frame_count=frame_count)


def _reader(path: Path, text: str) -> Callable[[Path, str], Iterable[Row]]:
    _, first = next(numbered_lines(text), (0, ""))
    if not first:
        raise TruthError(f"{path}: is empty; give {_FORMATS}")
    if first.startswith("<"):
        return cvat_rows
    return truth_rows if "," in first else kitti_rows


def kitti_rows(path: Path, text: str) -> Iterator[Row]:
    """Yield the vehicles and ignore regions of KITTI tracking labels.

    A line has 17 columns separated by spaces; frames and pixels count from 0. Car, Van and Truck
    are vehicles even if hidden or truncated; DontCare, Tram and Misc are ignore regions;
    Pedestrian, Person and Cyclist are skipped. Only the columns frame, id, type, left, top, right
    and bottom are used.
    Source: Geiger, Lenz, Urtasun, "Are we ready for autonomous driving?", CVPR 2012, and the readme
    of its tracking development kit.

    Raises
    ------
    TruthError
        A line has another number of columns, a column is not a number, or a type is unknown.
    """
    for line, content in numbered_lines(text):
        columns = content.split()
        if len(columns) != _KITTI_COLUMNS:
            what = f"KITTI tracking has 17 columns between spaces; this line has {len(columns)}"
            raise line_error(path, line, what)
        try:
            frame, track = parse_whole(columns[0]), parse_whole(columns[1])
            role = role_of(columns[2])
            corners = [parse_number(column) for column in columns[6:10]]
        except ValueError as error:
            raise line_error(path, line, str(error)) from error
        if role is not Role.OTHER:
            yield _row(line, frame, track, corners, role)


def _row(line: int, frame: int, track: int, corners: Iterable[float], role: Role) -> Row:
    """Return the row of a box given by its corners, in a frame counted from 0."""
    left, top, right, bottom = corners
    ignored = role is Role.IGNORED
    return Row(line, frame + 1, track, left, top, right - left, bottom - top, ignored=ignored)


def cvat_rows(path: Path, text: str) -> list[Row]:
    """Return the boxes of CVAT for video 1.1: XML with a track for every vehicle.

    Frames and pixels count from 0. Boxes that are `outside` are left out; boxes that are `occluded`
    count. Document types, and with them entities, are refused, so that a small file cannot expand
    into a large one.
    Source: the CVAT manual, "XML annotation format", section "Interpolation".

    Raises
    ------
    TruthError
        The XML is broken, declares a document type, is nested deeper than `MAX_DEPTH`, or is of
        another format.
    """
    reader = _CvatReader()
    reader.read(path, text)
    return reader.rows


class _CvatReader(XmlReader):
    """Collects the rows of a CVAT file."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[Row] = []
        self._track = 0
        self._role = Role.OTHER

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Take a track or a box."""
        match self.open:
            case ["annotations", "track"]:
                self._track = parse_whole(attribute(name, attributes, "id"))
                self._role = role_of(attribute(name, attributes, "label"))
            case ["annotations", "track", "box"]:
                self._box(attributes)
            case ["annotations", "track", _]:
                raise ValueError(f"<{name:.40}> in a track; only boxes can be scored")
            case ["annotations", "image"]:
                raise ValueError("CVAT for images; export the task as 'CVAT for video 1.1'")
            case [root] if root != "annotations":
                raise ValueError(f"<{name:.40}> where CVAT for video 1.1 has <annotations>")

    def _box(self, attributes: dict[str, str]) -> None:
        if parse_number(attributes.get("rotation", "0")):
            raise ValueError("the box is rotated; only upright boxes can be scored")
        frame = parse_whole(attribute("box", attributes, "frame"))
        corners = [
            parse_number(attribute("box", attributes, side))
            for side in ("xtl", "ytl", "xbr", "ybr")
        ]
        if self._role is Role.OTHER or parse_whole(attribute("box", attributes, "outside")):
            return
        self.rows.append(_row(self.line, frame, self._track, corners, self._role))
