"""YOLO: a text file of labels for each image or frame, and `data.yaml` with the classes.

A line has the number of a class, and the centre (x, y), width and height of the box as fractions of
the frame, or the points of a polygon. Tracks are in a zip file, and their lines end with the id.
The standard format has no id, but Ultralytics writes it in tracking, and so does CVAT ("Ultralytics
YOLO Detection Track"). The frame number, from 0, is at the end of the file name. `data.yaml` has
the names of the classes, and for tracks also `width` and `height` of the frames in pixels, which
other tools ignore. Source: docs.ultralytics.com, "Object detection datasets overview"; the CVAT
manual, "Ultralytics YOLO".
"""

import io
import json
import logging
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO

from vdet.archives import ArchiveError, list_members, open_archive, read_member, store
from vdet.boxes import Box
from vdet.config.document import MAX_BYTES as MAX_DESCRIPTION
from vdet.config.document import parse_document
from vdet.detect.classes import UNKNOWN
from vdet.errors import ConfigError, ImageError, OutputError, TruthError, escaped, printable
from vdet.labels.formats import Format, ImageTracks, SourceVideo
from vdet.labels.images import LabelledImage, paired_files
from vdet.labels.label import Label, SavedTracks, Size, limited
from vdet.labels.parsing import (
    LIMIT,
    MAX_BYTES,
    frame_number,
    label_lines,
    parse_number,
    parse_whole,
    read_bytes,
)
from vdet.media.images import read_header
from vdet.track.track import FrameTracks

_DATA = "data.yaml"
_COLUMNS = 5
_MIN_POLYGON = 7  # columns: the class and three points

log = logging.getLogger("vdet")


def _write(file: BinaryIO, video: SourceVideo, frames: Sequence[FrameTracks]) -> None:
    """Write the archive. Boxes are clipped to the frame; boxes outside it are omitted."""
    size = video.width, video.height
    classes: dict[str, int] = {}  # name: number, in the order of their numbers
    images = "".join(f"images/train/frame_{frame.index:06}.png\n" for frame in frames)
    texts = {"train.txt": images}
    for frame in frames:
        lines = (_line(t.box, t.class_name, size, classes, f" {t.id}") for t in frame.tracks)
        texts[f"labels/train/frame_{frame.index:06}.txt"] = "".join(lines)
    sides = f"width: {video.width}\nheight: {video.height}\n"
    _store(file, texts | {_DATA: _description("train.txt", classes) + sides})


def _write_images(file: BinaryIO, images: Sequence[ImageTracks]) -> None:
    """Write the archive, to be unpacked beside the folder `images`."""
    classes: dict[str, int] = {}
    texts: dict[str, str] = {}
    for image in images:
        name = f"labels/{image.path.with_suffix('.txt').as_posix()}"
        if name in texts:
            what = "YOLO needs images with different names; this one occurs with two endings"
            raise OutputError(f"{image.path.with_suffix('')}: {what}")
        lines = (_line(t.box, t.class_name, image.size, classes) for t in image.tracks)
        texts[name] = "".join(lines)
    _store(file, texts | {_DATA: _description("images", classes)})


def _store(file: BinaryIO, texts: Mapping[str, str]) -> None:
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in texts.items():
            store(archive, name, text)


def _description(images: str, classes: Iterable[str]) -> str:
    """Return the start of `data.yaml`; Ultralytics needs both `train` and `val`."""
    names = json.dumps([escaped(name) for name in classes] or [UNKNOWN], ensure_ascii=False)
    return f"path: .\ntrain: {images}\nval: {images}\nnames: {names}\n"


def _line(box: Box, name: str | None, size: Size, classes: dict[str, int], end: str = "") -> str:
    """Return the line of a box, and number its class."""
    width, height = size
    box = box.rounded.clipped(width, height)
    if not box.area:
        return ""
    number = classes.setdefault(name or UNKNOWN, len(classes))
    x, y = box.center
    ratios = (x / width, y / height, box.width / width, box.height / height)
    return f"{number} {' '.join(f'{ratio:.6f}' for ratio in ratios)}{end}\n"


def read_yolo(path: Path, data: bytes) -> SavedTracks:
    """Read the labels of every frame; frame numbers, from 0, are at the end of file names.

    A line may have the score before the id, as Ultralytics writes both. If the first number is 1, a
    warning says that numbers count from 0.

    Raises
    ------
    TruthError
        The archive is damaged, a name in it leads out of it, its labels are too large, `data.yaml`
        with names and frame size is missing, or a line is invalid.
    """
    members = _members(path, data)
    described = [name for name in members if PurePosixPath(name).name == _DATA]
    if not described:
        what = f"holds no {_DATA} (YOLO); unpack it, and use the file of labels in it"
        raise TruthError(f"{path}: {what}")
    first = min(described, key=lambda name: (name.count("/"), name))
    where = f"{path}:{printable(first)}"
    values, names = _described(members[first], where)
    size: Any = values.get("width"), values.get("height")
    if not all(isinstance(side, int) and 0 < side <= LIMIT for side in size):
        raise TruthError(f"{where}: needs the size of the frames, as width: 1280, height: 720")
    frames = sorted((_frame(path, name), name) for name in members if name not in described)
    if frames and frames[0][0] == 1:
        log.warning("%s: frames are numbered from 0, but the first file is for frame 1", path)
    parse = partial(_track_label, names=names, size=size)
    counts, form = (_COLUMNS + 1, _COLUMNS + 2), "YOLO with tracks"
    labels = (
        label._replace(frame=frame + 1)
        for frame, name in frames
        for label in label_lines(
            f"{path}:{printable(name)}", members[name], parse, form=form, counts=counts
        )
    )
    return SavedTracks(limited(path, labels), sorted({n for n, _ in frames}), size=size)


def _members(path: Path, data: bytes) -> dict[str, bytes]:
    """Return the label files and descriptions in a zip file, by their names.

    Raises
    ------
    TruthError
        The archive is damaged, a name in it leads out of it, or these files exceed `MAX_BYTES` in
        total.
    """
    try:
        names = [name for name in list_members(io.BytesIO(data)) if _is_wanted(PurePosixPath(name))]
        with open_archive(io.BytesIO(data)) as archive:
            if sum(archive.getinfo(name).file_size for name in names) > MAX_BYTES:
                what = f"its labels are larger than {MAX_BYTES:,} bytes; cut the video into parts"
                raise ArchiveError(what)
            return {name: read_member(archive, name, limit=MAX_BYTES) for name in names}
    except ArchiveError as error:
        raise TruthError(f"{path}: {error}") from error


def _is_wanted(name: PurePosixPath) -> bool:
    is_label_file = name.suffix.lower() == ".txt" and "labels" in name.parts[:-1]
    return is_label_file or name.name == _DATA


def _frame(path: Path, name: str) -> int:
    """Return the frame number of a label file."""
    number = frame_number(name)
    if number is None:
        raise TruthError(f"{path}: {printable(name)} must end in a frame number")
    return number


def _described(data: bytes, where: str) -> tuple[Mapping[str, Any], list[str]]:
    """Return the values of `data.yaml`, and the names of the classes in it."""
    if len(data) > MAX_DESCRIPTION:
        raise TruthError(f"{where}: is larger than {MAX_DESCRIPTION:,} bytes")
    try:
        values = parse_document(data.decode("utf-8-sig", "replace"), where).values
    except ConfigError as error:
        raise TruthError(error.args[0]) from error
    names = values.get("names")
    if isinstance(names, dict):  # number: name
        names = [names.get(str(number)) for number in range(len(names))]
    if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
        raise TruthError(f"{where}: names must be a list with all classes, or number them from 0")
    return values, names


def _label(place: int, columns: Sequence[str], names: Sequence[str], size: Size) -> Label:
    """Return the label of a line: a box, or a polygon with three points or more, as its box.

    Points less than a pixel outside the frame are moved to its side.

    Raises
    ------
    ValueError
        There are too few columns, the class has no name, or a number is not between 0 and 1.
    """
    count = len(columns)
    if count != _COLUMNS and (count < _MIN_POLYGON or count % 2 == 0):
        raise ValueError(
            f"YOLO has {_COLUMNS} columns, or the points of a polygon; this line has {count}"
        )
    number = parse_whole(columns[0])
    if not 0 <= number < len(names):
        raise ValueError(f"class {number} has no name; {_DATA} has {len(names)} names")
    xs, ys = ([_pixels(text, side) for text in columns[1 + n :: 2]] for n, side in enumerate(size))
    if count == _COLUMNS:  # middle and size
        xs, ys = ([middle - side / 2, middle + side / 2] for middle, side in (xs, ys))
    return Label(place, (min(xs), min(ys), max(xs), max(ys)), names[number])


def _pixels(text: str, side: int) -> float:
    """Return a fraction of a side of the frame in pixels. Raises ValueError."""
    pixels = parse_number(text) * side
    if not -1 <= pixels <= side + 1:
        raise ValueError("a number is not between 0 and 1; YOLO uses fractions of the image")
    return min(max(pixels, 0.0), float(side))


def _track_label(place: int, columns: Sequence[str], names: Sequence[str], size: Size) -> Label:
    """Return the label of a line with a box and its id, or its score and its id."""
    label = _label(place, columns[:_COLUMNS], names, size)
    score = parse_number(columns[_COLUMNS]) if len(columns) > _COLUMNS + 1 else 1.0
    return label._replace(id=parse_whole(columns[-1]), score=score)


def read_yolo_images(images: Path, labels: Path) -> Iterator[LabelledImage]:
    """Yield the images of a set; one without a label file shows no vehicle.

    Raises
    ------
    TruthError
        `data.yaml` is missing in the folder of the set and above it, an image cannot be read, or as
        for `read_yolo` or `paired_files`.
    """
    folder = images.parent
    data = next((p for p in (folder / _DATA, folder.parent / _DATA) if p.is_file()), None)
    if data is None:
        raise TruthError(f"{folder}: needs {_DATA} with the names of the classes, here or above")
    _, names = _described(read_bytes(data), str(data))
    for image, file in paired_files(images, labels):
        if file is None:
            yield LabelledImage(image, image)
            continue
        try:
            size, _ = read_header(image)
        except ImageError as error:
            raise TruthError(str(error)) from error
        parse = partial(_label, names=names, size=size)
        found = label_lines(file, read_bytes(file), parse, form="YOLO", counts=None)
        yield LabelledImage(image, file, tuple(found), size)


YOLO = Format("YOLO", ".yolo.zip", read_yolo, whole=_write, images=_write_images)
