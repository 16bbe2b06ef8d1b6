"""CVAT 1.1: XML with a track for every vehicle of a video, or with pictures and their boxes.

Frames and pixels count from 0.

CVAT takes from such a file only boxes with `keyframe="1"`, so every box is one. It continues a
track until a box that is `outside`, so there is one after the last box before each gap, and after
the end.
Source: the CVAT manual, "XML annotation format", section "Interpolation".
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO
from xml.etree import ElementTree as ET
from xml.sax.saxutils import escape, quoteattr

from vdet.boxes import Box
from vdet.detect.classes import UNKNOWN
from vdet.errors import TruthError, escaped
from vdet.labels.documents import attribute, read_xml, size_of, text_of
from vdet.labels.formats import Format, PictureTracks, SourceVideo, last_classes
from vdet.labels.label import Corners, Label, SavedTracks, known_size, limited, line_error
from vdet.labels.parsing import (
    archive_members,
    parse_corners,
    parse_number,
    parse_whole,
    read_bytes,
)
from vdet.labels.pictures import LabelledPicture, inside, picture_folder
from vdet.track.track import FrameTracks, State, Track

_MEMBER = "annotations.xml"  # in the zip file that CVAT exports
_MAX_LABELS = 1_000_000  # with those between key frames, which a small file may have many of
_SIDES = ("xtl", "ytl", "xbr", "ybr")


def _write(file: BinaryIO, video: SourceVideo, frames: Sequence[FrameTracks]) -> None:
    """Write a track for each vehicle; the box of a lost one is `occluded`."""
    count = max(frames[-1].index + 1 if frames else 0, video.frames or 0)
    boxes: dict[int, list[tuple[int, Track]]] = defaultdict(list)
    for frame in frames:
        for track in frame.tracks:
            boxes[track.id].append((frame.index, track))
    labels = {id_: escaped(name) for id_, name in last_classes(frames).items()}
    task = f"""<name>{escape(escaped(video.name))}</name>
    <size>{count}</size><mode>interpolation</mode>
    <start_frame>0</start_frame><stop_frame>{max(0, count - 1)}</stop_frame>
    <original_size><width>{video.width}</width><height>{video.height}</height></original_size>"""
    _write_head(file, task, labels.values())
    for id_, label in labels.items():
        file.write(f'  <track id="{id_}" label={quoteattr(label)} source="auto">\n'.encode())
        file.writelines(line.encode() for line in _box_lines(boxes[id_], count))
        file.write(b"  </track>\n")
    file.write(b"</annotations>\n")


def _write_pictures(file: BinaryIO, pictures: Sequence[PictureTracks]) -> None:
    names = [escaped(track.class_name or UNKNOWN) for item in pictures for track in item.tracks]
    _write_head(file, f"<size>{len(pictures)}</size><mode>annotation</mode>", names)
    for number, picture in enumerate(pictures):
        (width, height), path = picture.size, escaped(picture.path.as_posix())
        size = f'width="{width}" height="{height}"'
        file.write(f'  <image id="{number}" name={quoteattr(path)} {size}>\n'.encode())
        for track in picture.tracks:
            name = quoteattr(escaped(track.class_name or UNKNOWN))
            text = f'source="auto" occluded="0" {_corners(track.box)} z_order="0"'
            file.write(f"    <box label={name} {text}></box>\n".encode())
        file.write(b"  </image>\n")
    file.write(b"</annotations>\n")


def _write_head(file: BinaryIO, task: str, names: Iterable[str]) -> None:
    """Write the start of a file, up to the first track or picture."""
    labels = sorted(f"<label><name>{escape(name)}</name></label>" for name in set(names))
    head = f"""<?xml version="1.0" encoding="utf-8"?>
<annotations>
  <version>1.1</version>
  <meta><task>
    {task}
    <labels>{"".join(labels)}</labels>
  </task></meta>
"""
    file.write(head.encode())


def _corners(box: Box) -> str:
    x1, y1, x2, y2 = box.pixels
    return f'xtl="{x1:.2f}" ytl="{y1:.2f}" xbr="{x2:.2f}" ybr="{y2:.2f}"'


def _box_lines(boxes: Sequence[tuple[int, Track]], count: int) -> Iterator[str]:
    """Yield the boxes of a track, and a box outside in the frame after each stretch of them."""
    following = [frame for frame, _ in boxes[1:]]
    for (frame, track), after in zip(boxes, [*following, None], strict=True):
        lost = int(track.state == "predicted")
        text = f'occluded="{lost}" keyframe="1" {_corners(track.box)} z_order="0"'
        yield f'    <box frame="{frame}" outside="0" {text}></box>\n'
        if after != frame + 1 and frame + 1 < count:
            yield f'    <box frame="{frame + 1}" outside="1" {text}></box>\n'


_Key = tuple[Label, bool]
"""A box that stands in the file, and whether it is outside: that ends the one before."""


def read_cvat(path: Path, data: bytes) -> SavedTracks:
    """Read the XML, or the zip file with `annotations.xml` that CVAT exports.

    The file speaks of the frames of its task or job, which may begin late or leave out frames. A
    box holds until the next one of its track: it moves there evenly, or ends there if that one is
    `outside`. The last one holds to the end of the task. A vehicle whose box is `occluded` is lost.

    Raises
    ------
    TruthError
        The XML is broken, declares a document type, is beyond a limit or of another format, a box
        lies in a frame that the task leaves out, or it is not known which frames that are.
    """
    root = read_xml(path, _content(path, data), "annotations")
    if root.find("image") is not None:
        raise TruthError(f"{path}: CVAT for images; export the task as 'CVAT for video 1.1'")
    try:
        size = size_of(root.find("meta//original_size"))
        covered = _frames([*root.iterfind("meta//task"), *root.iterfind("meta//job")])
    except ValueError as error:
        raise line_error(path, "meta", str(error)) from error
    labels = limited(path, _labels(path, root, covered), _MAX_LABELS)
    return SavedTracks(labels, covered, size=size)


def read_cvat_pictures(path: Path) -> Iterator[LabelledPicture]:
    """Yield every picture of a file of "CVAT for images 1.1".

    Pictures lie where `picture_folder` says. Errors as of `read_cvat`.
    """
    folder = None
    for image in read_xml(path, read_bytes(path), "annotations").iterfind("image"):
        place = f"image {image.get('id', ''):.40}"
        try:
            name, size = inside(attribute(image, "name")), None
            if "width" in image.attrib:
                size = known_size(
                    *(parse_whole(attribute(image, side)) for side in ("width", "height"))
                )
            labels = tuple(Label(place, _sides(box), attribute(box, "label")) for box in image)
        except ValueError as error:
            raise line_error(path, place, str(error)) from error
        folder = folder or picture_folder(path, name)
        yield LabelledPicture(folder / name, path, labels, size)


def _labels(path: Path, root: ET.Element, covered: range | None) -> Iterator[Label]:
    """Yield the boxes of all tracks. Raises `TruthError`."""
    for track in root.iterfind("track"):
        try:
            keys = sorted((_key(track, box) for box in track), key=lambda key: key[0].frame)
            yield from _boxes(covered, keys)
        except ValueError as error:
            raise line_error(path, f"track {track.get('id', ''):.40}", str(error)) from error


def _content(path: Path, data: bytes) -> bytes:
    """Return the XML, also from the zip file."""
    if not data.startswith(b"PK"):
        return data
    members = archive_members(path, data, lambda name: str(name) == _MEMBER)
    if not members:
        raise TruthError(f"{path}: has no {_MEMBER}; export the task as 'CVAT for video 1.1'")
    return members[_MEMBER]


def _frames(tasks: Sequence[ET.Element]) -> range | None:
    """Return the frames of the only task, counted from 0; None if it does not name them."""
    if len(tasks) > 1:
        raise ValueError("has several tasks; export each as 'CVAT for video 1.1'")
    names = ("start_frame", "stop_frame")
    if not tasks or any(tasks[0].find(name) is None for name in names):
        return None
    rule = tasks[0].findtext("frame_filter", "").strip()
    step = re.fullmatch(r"(?:step=0*([1-9][0-9]{0,6}))?", rule)
    if step is None:
        raise ValueError(f"unknown frame filter {rule!r:.40}; only step=NUMBER is supported")
    first, last = (parse_whole(text_of(tasks[0], name)) for name in names)
    if last - first > _MAX_LABELS:
        raise ValueError(f"has more than {_MAX_LABELS:,} frames; cut the video into parts")
    return range(first, last + 1, int(step[1] or 1))


def _key(track: ET.Element, box: ET.Element) -> _Key:
    sides, name = _sides(box), attribute(track, "label")
    id_, frame = parse_whole(attribute(track, "id")), parse_whole(attribute(box, "frame"))
    state: State = "predicted" if box.get("occluded") == "1" else "detected"
    label = Label(f"track {id_}", sides, name, frame + 1, id_, state=state)
    return label, attribute(box, "outside") == "1"


def _sides(box: ET.Element) -> Corners:
    if box.tag != "box":
        raise ValueError(f"<{box.tag:.40}> is not a box; only boxes can be scored")
    if parse_number(box.get("rotation", "0")):
        raise ValueError("the box is rotated; only upright boxes can be scored")
    return parse_corners([attribute(box, side) for side in _SIDES])


def _boxes(covered: range | None, keys: Sequence[_Key]) -> Iterator[Label]:
    """Yield the boxes of a track in all frames that are covered; None: in all up to its last."""
    step = covered.step if covered else 1
    for number, (label, outside) in enumerate(keys):
        if outside:
            continue
        index = label.frame - 1
        if covered is not None and index not in covered:
            every = f"every {step}. frame" if step > 1 else "the frames"
            what = f"it has {every} from {covered.start} to {covered.stop - 1}"
            raise ValueError(f"the task has no frame {index}; {what}")
        yield label
        after = keys[number + 1][0] if number + 1 < len(keys) else None
        end = after.frame - 1 if after else covered.stop if covered else index + 1
        for frame in range(index + step, end, step):
            ratio = (frame - index) / (end - index) if after else 0.0
            yield label._replace(frame=frame + 1, box=_between(label, after or label, ratio))


def _between(label: Label, after: Label, ratio: float) -> Corners:
    x1, y1, x2, y2 = (a + ratio * (b - a) for a, b in zip(label.box, after.box, strict=True))
    return x1, y1, x2, y2


CVAT = Format("CVAT for video 1.1", ".xml", read_cvat, whole=_write, pictures=_write_pictures)
