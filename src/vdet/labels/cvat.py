"""CVAT for video 1.1: XML with a track for every vehicle; frames and pixels count from 0.

CVAT takes from such a file only boxes with `keyframe="1"`, so every box is one. It continues a
track until a box that is `outside`, so there is one after the last box before each gap, and after
the end.
Source: the CVAT manual, "XML annotation format", section "Interpolation".
"""

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import BinaryIO, NamedTuple
from xml.sax.saxutils import escape, quoteattr

from vdet.errors import TruthError, escaped
from vdet.labels.formats import Format, SourceVideo, last_classes
from vdet.labels.label import Corners, Label, limited, line_error
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
    labels = {id_: escaped(name) for id_, name in last_classes(frames).items()}
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

    The file speaks of the frames of its task or job, which may begin late or leave out frames. A
    box holds until the next one of its track: it moves there evenly, or ends there if that one is
    `outside`. The last one holds to the end of the task. A vehicle whose box is `occluded` is lost.

    Raises
    ------
    TruthError
        The XML is broken, declares a document type, is beyond a limit or of another format, a box
        lies in a frame that the task leaves out, or it is not known which frames that are.
    """
    tracks: list[list[_Key]] = [[]]  # the last one has not ended
    sizes: list[tuple[int, int] | None] = []
    tasks: list[range | None] = []

    def take(opened: list[Element]) -> None:
        match [each.name for each in opened]:
            case ["annotations", "track", "box"]:
                tracks[-1].append(_key(*opened[1:]))
            case ["annotations", "track"]:
                opened[-1].attribute("id")
                opened[-1].attribute("label")
                tracks.append([])
            case ["annotations", "track", name]:
                raise ValueError(f"<{name:.40}> in a track; only boxes can be scored")
            case ["annotations", "image"]:
                raise ValueError("CVAT for images; export the task as 'CVAT for video 1.1'")
            case ["annotations", "meta", *_, "original_size"]:
                sizes.append(opened[-1].size)
            case ["annotations", "meta", *_, "task" | "job"]:
                tasks.append(_frames(opened[-1]))

    read_xml(path, _content(path, data), "annotations", take)
    covered, size = _only(path, tasks), next(iter(sizes), None)
    labels = chain.from_iterable(map(partial(_boxes, path, covered), tracks))
    return SavedTracks(tuple(limited(path, labels)), size=size, covered=covered)


def _only(path: Path, tasks: Sequence[range | None]) -> range | None:
    """Return the frames of the only task; None if they are not known."""
    if len(tasks) > 1:
        raise TruthError(f"{path}: has several tasks; export each as 'CVAT for video 1.1'")
    return next(iter(tasks), None)


def _content(path: Path, data: bytes) -> bytes:
    """Return the XML, also from the zip file."""
    if not data.startswith(b"PK"):
        return data
    members = archive_members(path, data, lambda name: str(name) == _MEMBER)
    if not members:
        raise TruthError(f"{path}: has no {_MEMBER}; export the task as 'CVAT for video 1.1'")
    return members[_MEMBER]


def _frames(task: Element) -> range | None:
    """Return the frames of a task, counted from 0; None if it does not name them."""
    if not {"start_frame", "stop_frame"} <= task.values.keys():
        return None
    rule = task.values.get("frame_filter", [""])[0].strip()
    step = re.fullmatch(r"(?:step=0*([1-9][0-9]{0,6}))?", rule)
    if step is None:
        raise ValueError(f"the frame filter {rule!r:.40} is unknown; only step=NUMBER is known")
    first, last = (parse_whole(task.value(name)) for name in ("start_frame", "stop_frame"))
    return range(first, last + 1, int(step[1] or 1))


class _Key(NamedTuple):
    """A box that stands in the file; one that is `outside` ends the one before."""

    label: Label
    outside: bool


def _key(track: Element, box: Element) -> _Key:
    if parse_number(box.attributes.get("rotation", "0")):
        raise ValueError("the box is rotated; only upright boxes can be scored")
    frame, id_ = parse_whole(box.attribute("frame")), parse_whole(track.attribute("id"))
    left, top, right, bottom = (
        parse_number(box.attribute(side)) for side in ("xtl", "ytl", "xbr", "ybr")
    )
    state: State = "lost" if parse_whole(box.attributes.get("occluded", "0")) == 1 else "seen"
    corners, name = (left, top, right, bottom), track.attribute("label")
    label = Label(box.line, corners, name, frame + 1, id_, state=state)
    return _Key(label, bool(parse_whole(box.attribute("outside"))))


def _boxes(path: Path, covered: range | None, keys: list[_Key]) -> Iterator[Label]:
    """Yield the boxes of a track in all frames that are covered; None: in all up to its last."""
    keys.sort(key=lambda key: key.label.frame)
    step = covered.step if covered else 1
    for number, (label, outside) in enumerate(keys):
        index = label.frame - 1
        if covered is not None and index not in covered and not outside:
            what = f"the box is in frame {index}, which the task does not have"
            raise line_error(path, label.place, f"{what}; it has {_shown(covered)}")
        if outside:
            continue
        yield label
        after = keys[number + 1].label if number + 1 < len(keys) else None
        end = after.frame - 1 if after else covered.stop if covered else index + 1
        for frame in range(index + step, end, step):
            share = (frame - index) / (end - index) if after else 0.0
            yield label._replace(frame=frame + 1, box=_between(label, after or label, share))


def _between(label: Label, after: Label, share: float) -> Corners:
    x1, y1, x2, y2 = (a + share * (b - a) for a, b in zip(label.box, after.box, strict=True))
    return x1, y1, x2, y2


def _shown(covered: range) -> str:
    every = f"every {covered.step}. frame" if covered.step > 1 else "the frames"
    return f"{every} from {covered.start} to {covered.stop - 1}"


CVAT = Format("CVAT for video 1.1", ".xml", read_cvat, whole=_write)
