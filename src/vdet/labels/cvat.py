"""CVAT for video 1.1: XML with a track for every vehicle; frames and pixels count from 0.

CVAT takes from such a file only boxes with `keyframe="1"`, so every box is one. It continues a
track until a box that is `outside`, so there is one after the last box before each gap, and after
the end.
Source: the CVAT manual, "XML annotation format", section "Interpolation".
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO
from xml.sax.saxutils import escape, quoteattr

from vdet.errors import TruthError, escaped
from vdet.labels.formats import Format, SourceVideo, best_classes
from vdet.labels.label import Label, limited
from vdet.labels.parsing import archive_members, parse_number, parse_whole
from vdet.labels.video import SavedTracks
from vdet.labels.xml_reader import Element, read_xml
from vdet.track.track import FrameTracks, State, Track

_MEMBER = "annotations.xml"  # in the zip file that CVAT exports


def _write(file: BinaryIO, video: SourceVideo, frames: Sequence[FrameTracks]) -> None:
    """Write a track for each vehicle; the box of a lost one is `occluded`."""
    for line in _lines(video, frames):
        file.write(f"{line}\n".encode())


def _lines(video: SourceVideo, frames: Sequence[FrameTracks]) -> Iterator[str]:
    count = max(frames[-1].index + 1 if frames else 0, video.frames or 0)
    boxes: dict[int, list[tuple[int, Track]]] = defaultdict(list)
    for frame in frames:
        for track in frame.tracks:
            boxes[track.id].append((frame.index, track))
    labels = {id_: escaped(name) for id_, name in best_classes(frames).items()}
    names = sorted(f"<label><name>{escape(each)}</name></label>" for each in set(labels.values()))
    yield '<?xml version="1.0" encoding="utf-8"?>'
    yield "<annotations>"
    yield "  <version>1.1</version>"
    yield "  <meta><task>"
    yield f"    <name>{escape(escaped(video.name))}</name>"
    yield f"    <size>{count}</size><mode>interpolation</mode>"
    yield f"    <start_frame>0</start_frame><stop_frame>{max(0, count - 1)}</stop_frame>"
    yield f"    <labels>{''.join(names)}</labels>"
    size = f"<width>{video.width}</width><height>{video.height}</height>"
    yield f"    <original_size>{size}</original_size>"
    yield "  </task></meta>"
    for id_, label in labels.items():
        yield f'  <track id="{id_}" label={quoteattr(label)} source="auto">'
        yield from _box_lines(boxes[id_], count)
        yield "  </track>"
    yield "</annotations>"


def _box_lines(boxes: Sequence[tuple[int, Track]], count: int) -> Iterator[str]:
    """Yield the boxes of a track, and a box outside in the frame after each stretch of them."""
    following = [frame for frame, _ in boxes[1:]]
    for (frame, track), after in zip(boxes, [*following, None], strict=True):
        x1, y1, x2, y2 = track.box.pixels
        corners = f'xtl="{x1:.2f}" ytl="{y1:.2f}" xbr="{x2:.2f}" ybr="{y2:.2f}"'
        text = f'occluded="{int(track.state == "lost")}" keyframe="1" {corners} z_order="0"'
        yield f'    <box frame="{frame}" outside="0" {text}></box>'
        if after != frame + 1 and frame + 1 < count:
            yield f'    <box frame="{frame + 1}" outside="1" {text}></box>'


def read_cvat(path: Path, data: bytes) -> SavedTracks:
    """Read the XML, or the zip file with `annotations.xml` that CVAT exports.

    Boxes that are `outside` are left out; a vehicle whose box is `occluded` is lost. Every frame
    has its own box, as CVAT exports it; nothing is interpolated.

    Raises
    ------
    TruthError
        The XML is broken, declares a document type, is nested too deep, or is of another format.
    """
    labels: list[Label] = []
    size: list[tuple[int, int] | None] = [None]

    def take(opened: list[Element]) -> None:
        match [each.name for each in opened]:
            case ["annotations", "track", "box"]:
                labels.extend(_labels(*opened[1:]))
            case ["annotations", "track"]:
                opened[-1].attribute("id")
                opened[-1].attribute("label")
            case ["annotations", "track", name]:
                raise ValueError(f"<{name:.40}> in a track; only boxes can be scored")
            case ["annotations", "image"]:
                raise ValueError("CVAT for images; export the task as 'CVAT for video 1.1'")
            case ["annotations", "meta", _, "original_size"]:
                size[0] = opened[-1].size

    read_xml(path, _content(path, data), "annotations", take)
    return SavedTracks(tuple(limited(path, labels)), size=size[0])


def _content(path: Path, data: bytes) -> bytes:
    """Return the XML, also from the zip file."""
    if not data.startswith(b"PK"):
        return data
    members = archive_members(path, data, lambda name: str(name) == _MEMBER)
    if not members:
        raise TruthError(f"{path}: has no {_MEMBER}; export the task as 'CVAT for video 1.1'")
    return members[_MEMBER]


def _labels(track: Element, box: Element) -> Iterator[Label]:
    """Yield the label of a box, unless it is outside."""
    if parse_number(box.attributes.get("rotation", "0")):
        raise ValueError("the box is rotated; only upright boxes can be scored")
    frame, id_ = parse_whole(box.attribute("frame")), parse_whole(track.attribute("id"))
    left, top, right, bottom = (
        parse_number(box.attribute(side)) for side in ("xtl", "ytl", "xbr", "ybr")
    )
    state: State = "lost" if parse_whole(box.attributes.get("occluded", "0")) == 1 else "seen"
    name = track.attribute("label")
    if not parse_whole(box.attribute("outside")):
        corners = left, top, right, bottom
        yield Label(box.line, corners, name, frame + 1, id_, state=state)


CVAT = Format("CVAT for video 1.1", ".xml", read_cvat, whole=_write)
