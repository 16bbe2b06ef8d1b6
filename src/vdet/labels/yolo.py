"""YOLO: a text file of labels for each picture or frame, and `data.yaml` with the classes.

A line is the number of a class, and the centre (x, y), width and height of the box as shares of the
frame, or the points of a polygon. Tracks lie in a zip file, and their lines end with the id. The
standard form has no id, but Ultralytics writes it in tracking, and so does CVAT ("Ultralytics YOLO
Detection Track").
`data.yaml` has the names of the classes, and for tracks also `width` and `height` of the frames in
pixels, which others ignore.
Source: docs.ultralytics.com, "Object detection datasets overview"; the CVAT manual, "Ultralytics
YOLO".
"""

import json
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO

from vdet.archives import store
from vdet.config.document import MAX_BYTES, parse_document
from vdet.errors import ConfigError, ImageError, TruthError, escaped, printable
from vdet.labels import parsing
from vdet.labels.formats import UNKNOWN, Format, PictureFormat, SourceVideo
from vdet.labels.label import Label, limited
from vdet.labels.parsing import archive_members, label_lines, parse_number, parse_whole, read_bytes
from vdet.labels.pictures import LabelledPicture, pictures_below
from vdet.labels.video import SavedTracks
from vdet.media.images import read_header
from vdet.track.track import FrameTracks, Track

_DATA = "data.yaml"
_NO_LABELS = "classes.txt"  # label tools write it beside the labels
_NUMBER = re.compile(r"([0-9]{1,8})$", re.ASCII)
_COLUMNS = 5
_POLYGON_COLUMNS = 7  # the least: the class and three points

Size = tuple[int, int]
"""Width and height in pixels."""


def _write(file: BinaryIO, video: SourceVideo, frames: Sequence[FrameTracks]) -> None:
    """Write the archive. Boxes end at the sides of the frame; one outside of it is left out."""
    size = video.width, video.height
    classes: dict[str, int] = {}  # name: number, in the order of their numbers
    names = {frame.index: f"frame_{frame.index:06}" for frame in frames}
    pictures = "".join(f"images/train/{name}.png\n" for name in names.values())
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        store(archive, "train.txt", pictures)
        for frame in frames:
            lines = "".join(_line(track, size, classes) for track in frame.tracks)
            store(archive, f"labels/train/{names[frame.index]}.txt", lines)
        listed = "".join(
            f"  {number}: {json.dumps(escaped(name), ensure_ascii=False)}\n"
            for name, number in (classes or {UNKNOWN: 0}).items()
        )
        sides = "width: {}\nheight: {}\n".format(*size)
        parts = "train: train.txt\nval: train.txt\n"  # Ultralytics needs both
        store(archive, _DATA, f"path: .\n{parts}names:\n{listed}{sides}")


def _line(track: Track, size: Size, classes: dict[str, int]) -> str:
    """Return the line of a track, and give its class a number."""
    width, height = size
    box = track.box.rounded.clipped(width, height)
    if not box.area:
        return ""
    number = classes.setdefault(track.class_name or UNKNOWN, len(classes))
    x, y = box.center
    shares = (x / width, y / height, box.width / width, box.height / height)
    return f"{number} {' '.join(f'{share:.6f}' for share in shares)} {track.id}\n"


def read_yolo(path: Path, data: bytes) -> SavedTracks:
    """Read the labels of every frame, whose number from 0 stands at the end of its file's name.

    A line may have the score before the id, as Ultralytics writes both.

    Raises
    ------
    TruthError
        The archive is damaged, a name in it leads out of it, its labels are too large, there is no
        `data.yaml` with names and the size of the frames, two files are of one frame, or a line is
        not of this form.
    """
    members = archive_members(path, data, _is_wanted)
    described = [name for name in members if PurePosixPath(name).name == _DATA]
    if not described:
        raise TruthError(f"{path}: needs {_DATA} with the names of the classes")
    first = min(described, key=lambda name: (name.count("/"), name))
    where = f"{path}:{printable(first)}"
    values = _values(members[first], where)
    names = _class_names(values, where)
    size: Any = values.get("width"), values.get("height")
    if not all(isinstance(side, int) and 0 < side <= parsing.LIMIT for side in size):
        raise TruthError(f"{where}: needs the size of the frames, as width: 1280, height: 720")
    frames = _frames(path, [name for name in members if name not in described])
    read = partial(label_lines, form="YOLO with tracks", counts=(_COLUMNS + 1, _COLUMNS + 2))

    def labels() -> Iterator[Label]:
        for index, name in sorted(frames.items()):
            parse = partial(_track_label, names=names, size=size, frame=index + 1)
            yield from read(path, members[name], parse, member=printable(name))

    return SavedTracks(tuple(limited(path, labels())), listed=tuple(sorted(frames)), size=size)


def _values(data: bytes, where: str) -> Mapping[str, Any]:
    """Return the values of `data.yaml`."""
    if len(data) > MAX_BYTES:
        raise TruthError(f"{where}: is larger than {MAX_BYTES:,} bytes")
    try:
        return parse_document(data.decode("utf-8-sig"), where).values
    except UnicodeDecodeError as error:
        raise TruthError(f"{where}: is not text (UTF-8)") from error
    except ConfigError as error:
        raise TruthError(str(error).splitlines()[0]) from error


def _class_names(values: Mapping[str, Any], where: str) -> list[str]:
    """Return `names` of the values of `data.yaml`, a list or numbered."""
    names = values.get("names")
    if isinstance(names, dict):  # number: name
        names = [names.get(str(number)) for number in range(len(names))]
    if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
        raise TruthError(f"{where}: names must be a list with all classes, or number them from 0")
    return names


def _frames(path: Path, names: Sequence[str]) -> dict[int, str]:
    """Return the names of files of labels by their frame."""
    files: dict[int, str] = {}
    for name in names:
        number = _NUMBER.search(PurePosixPath(name).stem)
        if number is None:
            raise TruthError(f"{path}: {printable(name)} has no number of a frame at its end")
        other = files.setdefault(int(number[1]), name)
        if other != name:
            both = f"{printable(other)} and {printable(name)}"
            raise TruthError(f"{path}: {both} are of one frame")
    return files


def _is_wanted(name: PurePosixPath) -> bool:
    is_label_file = name.suffix.lower() == ".txt" and "labels" in name.parts[:-1]
    return is_label_file or name.name == _DATA


def _label(place: int | str, columns: Sequence[str], names: Sequence[str], size: Size) -> Label:
    """Return the label of a line: a box, or a polygon with three points or more, as its box.

    Raises
    ------
    ValueError
        There are too few columns, the class has no name, or a number is not between 0 and 1.
    """
    count = len(columns)
    if count != _COLUMNS and (count < _POLYGON_COLUMNS or count % 2 == 0):
        raise ValueError(
            f"YOLO has {_COLUMNS} columns, or the points of a polygon; this line has {count}"
        )
    number = parse_whole(columns[0])
    if not 0 <= number < len(names):
        raise ValueError(f"class {number} has no name; {_DATA} has {len(names)} names")
    shares = [parse_number(column) for column in columns[1:]]
    if not all(0 <= share <= 1 for share in shares):
        raise ValueError("a number is not between 0 and 1; YOLO has shares of the picture")
    xs, ys = ([share * side for share in shares[i::2]] for i, side in enumerate(size))
    if count == _COLUMNS:  # middle and size
        xs, ys = ([middle - side / 2, middle + side / 2] for middle, side in (xs, ys))
    return Label(place, (min(xs), min(ys), max(xs), max(ys)), names[number])


def _track_label(
    place: int | str, columns: Sequence[str], names: Sequence[str], size: Size, frame: int
) -> Label:
    """Return the label of a line with a box and its id, or its score and its id."""
    label = _label(place, columns[:_COLUMNS], names, size)
    score = parse_number(columns[_COLUMNS]) if len(columns) > _COLUMNS + 1 else 1.0
    return label._replace(frame=frame, id=parse_whole(columns[-1]), score=score)


def read_yolo_pictures(folder: Path) -> Iterator[LabelledPicture]:
    """Yield every picture below `images`; one without a file in `labels` shows no vehicle.

    `data.yaml` lies in the folder or above it.

    Raises
    ------
    TruthError
        There are no names, a file of labels has no picture, a line is not of this form, or the
        size of a labelled picture cannot be read.
    """
    data = next((p for p in (folder / _DATA, folder.parent / _DATA) if p.is_file()), None)
    if data is None:
        raise TruthError(f"{folder}: needs {_DATA} with the names of the classes, here or above")
    names = _class_names(_values(read_bytes(data), str(data)), str(data))
    images, labels = folder / "images", folder / "labels"
    files = {file for file in labels.rglob("*.txt") if file.name != _NO_LABELS and file.is_file()}
    for picture in pictures_below(images):
        file = labels / picture.relative_to(images).with_suffix(".txt")
        if file in files:
            files.remove(file)
            yield _labelled(picture, file, names)
        else:
            yield LabelledPicture(picture, file)
    if files:
        raise TruthError(f"{min(files)}: has no picture of its name below {images}")


def _labelled(picture: Path, file: Path, names: Sequence[str]) -> LabelledPicture:
    try:
        size, _ = read_header(picture)
    except ImageError as error:
        raise TruthError(str(error)) from error
    parse = partial(_label, names=names, size=size)
    labels = label_lines(file, read_bytes(file), parse, form="YOLO", counts=None)
    return LabelledPicture(picture, file, tuple(labels), size)


YOLO = Format("YOLO", ".yolo.zip", read_yolo, whole=_write)
YOLO_PICTURES = PictureFormat("YOLO", ("images", "labels"), read_yolo_pictures)
