"""CVAT for video 1.1: XML with a track for every vehicle; frames and pixels count from 0.

CVAT takes from such a file only boxes with `keyframe="1"`, so every box is one. It continues a
track until a box that is `outside`, so there is one after the last box before each gap, and after
the end.
Source: the CVAT manual, "XML annotation format", section "Interpolation".
"""

import io
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO
from xml.sax.saxutils import escape, quoteattr

from vdet.archives import ArchiveError, list_members, open_archive, read_member
from vdet.errors import TruthError
from vdet.files import escaped
from vdet.labels.parsing import MAX_BYTES, parse_number, parse_whole, text_of
from vdet.labels.protocol import Format, SourceVideo, TrackLabels
from vdet.labels.rows import Row, limited
from vdet.labels.saved import SavedTracks
from vdet.labels.xml_reader import XmlReader, attribute
from vdet.lanes.road import Road
from vdet.track.track import FrameTracks

MEMBER = "annotations.xml"
"""The XML file in the zip file that CVAT exports."""

_MAX_TEXT = 1000  # characters


class CvatWriter:
    """Keeps the boxes of each track, and writes all at the end.

    A predicted box is `occluded`. The label of a track is the class with most score, or `vehicle`.
    """

    def __init__(self, file: BinaryIO, video: SourceVideo | None) -> None:
        assert video is not None  # `needs_video` says so
        self._file = file
        self._video = video
        self._boxes: dict[int, list[tuple[int, str]]] = defaultdict(list)  # frame and its XML
        self._labels = TrackLabels()
        self._frames = 0

    def write(self, frame: FrameTracks, road: Road | None = None) -> None:  # noqa: ARG002
        """Keep the boxes of a frame."""
        self._frames = frame.index + 1
        for track in frame.tracks:
            box = track.box
            corners = (
                f'xtl="{box.x:.2f}" ytl="{box.y:.2f}" xbr="{box.right:.2f}" ybr="{box.bottom:.2f}"'
            )
            text = f'occluded="{int(track.predicted)}" keyframe="1" {corners} z_order="0"'
            self._boxes[track.id].append((frame.index, text))
            self._labels.add(track)

    def end(self) -> None:
        """Write the whole file."""
        for line in self._lines():
            self._file.write(f"{line}\n".encode())

    def _lines(self) -> Iterator[str]:
        video = self._video
        count = max(self._frames, video.frames or 0)
        labels = {number: escaped(self._labels.label(number)) for number in sorted(self._boxes)}
        yield '<?xml version="1.0" encoding="utf-8"?>'
        yield "<annotations>"
        yield "  <version>1.1</version>"
        yield "  <meta><task>"
        yield f"    <name>{escape(escaped(video.name))}</name>"
        yield f"    <size>{count}</size><mode>interpolation</mode>"
        yield f"    <start_frame>0</start_frame><stop_frame>{max(0, count - 1)}</stop_frame>"
        yield "    <labels>"
        for label in sorted(set(labels.values())):
            yield f"      <label><name>{escape(label)}</name></label>"
        yield "    </labels>"
        size = f"<width>{video.width}</width><height>{video.height}</height>"
        yield f"    <original_size>{size}</original_size>"
        yield "  </task></meta>"
        for number, label in labels.items():
            yield f'  <track id="{number}" label={quoteattr(label)} source="auto">'
            yield from _box_lines(self._boxes[number], count)
            yield "  </track>"
        yield "</annotations>"


def _box_lines(boxes: list[tuple[int, str]], count: int) -> Iterator[str]:
    """Yield the boxes of a track, and a box outside in the frame after each stretch of them."""
    following = [frame for frame, _ in boxes[1:]]
    for (frame, text), after in zip(boxes, [*following, None], strict=True):
        yield f'    <box frame="{frame}" outside="0" {text}></box>'
        if after != frame + 1 and frame + 1 < count:
            yield f'    <box frame="{frame + 1}" outside="1" {text}></box>'


def read_cvat(path: Path, data: bytes) -> SavedTracks:
    """Read the XML, or the zip file with `annotations.xml` that CVAT exports.

    Boxes that are `outside` are left out, boxes that are `occluded` are `predicted`. Every frame
    has its own box, as CVAT exports it; nothing is interpolated. Document types, and with them
    entities, are refused, so that a small file cannot expand into a large one.

    Raises
    ------
    TruthError
        The XML is broken, declares a document type, is nested deeper than `MAX_DEPTH`, or is of
        another format.
    """
    if data.startswith(b"PK"):
        data = _unpacked(path, data)
    reader = _CvatReader()
    reader.read(path, text_of(path, data))
    return SavedTracks(tuple(limited(path, reader.rows)), size=reader.size)


def _unpacked(path: Path, data: bytes) -> bytes:
    try:
        list_members(io.BytesIO(data))
        with open_archive(io.BytesIO(data)) as archive:
            return read_member(archive, MEMBER, most=MAX_BYTES)
    except ArchiveError as error:
        raise TruthError(f"{path}: {error}") from error


class _CvatReader(XmlReader):
    """Collects the rows of a CVAT file."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[Row] = []
        self._track = 0
        self._label = ""
        self._sides: dict[str, int] = {}
        self._text: str | None = None

    @property
    def size(self) -> tuple[int, int] | None:
        width, height = self._sides.get("width", 0), self._sides.get("height", 0)
        return (width, height) if width > 0 and height > 0 else None

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Take a track or a box."""
        match self.open:
            case ["annotations", "track"]:
                self._track = parse_whole(attribute(name, attributes, "id"))
                self._label = attribute(name, attributes, "label")
            case ["annotations", "track", "box"]:
                self._box(attributes)
            case ["annotations", "track", _]:
                raise ValueError(f"<{name:.40}> in a track; only boxes can be scored")
            case ["annotations", "image"]:
                raise ValueError("CVAT for images; export the task as 'CVAT for video 1.1'")
            case ["annotations", "meta", _, "original_size", "width" | "height"]:
                self._text = ""
            case [root] if root != "annotations":
                raise ValueError(f"<{name:.40}> where CVAT for video 1.1 has <annotations>")

    def text(self, text: str) -> None:
        """Take a part of a number."""
        if self._text is not None:
            self._text += text
            if len(self._text) > _MAX_TEXT:
                raise ValueError(f"a value has more than {_MAX_TEXT} characters")

    def end(self) -> None:
        """Take a side of the frames."""
        if self._text is not None:
            self._sides[self.open[-1]] = parse_whole(self._text)
            self._text = None

    def _box(self, attributes: dict[str, str]) -> None:
        if parse_number(attributes.get("rotation", "0")):
            raise ValueError("the box is rotated; only upright boxes can be scored")
        frame = parse_whole(attribute("box", attributes, "frame"))
        left, top, right, bottom = (
            parse_number(attribute("box", attributes, side))
            for side in ("xtl", "ytl", "xbr", "ybr")
        )
        predicted = parse_whole(attributes.get("occluded", "0")) == 1
        if parse_whole(attribute("box", attributes, "outside")):
            return
        place = left, top, right - left, bottom - top
        self.rows.append(
            Row(self.line, frame + 1, self._track, *place, label=self._label, predicted=predicted)
        )


CVAT = Format("CVAT for video 1.1", ".xml", CvatWriter, read_cvat, needs_video=True)
