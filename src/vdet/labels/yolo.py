"""YOLO: a text file of labels for each picture or frame, and `data.yaml` with the classes.

A line is the number of a class, and x and y of the middle, width and height of the box as shares of
the frame. Tracks lie in a zip file, and their lines end with the id: the standard form has none,
but Ultralytics writes it when it tracks, and so does CVAT ("Ultralytics YOLO Detection Track").
`data.yaml` has the names of the classes, and for tracks also `width` and `height` of the frames in
pixels, which others ignore.
Source: docs.ultralytics.com, "Object detection datasets overview"; the CVAT manual, "Ultralytics
YOLO".
"""

import io
import json
import re
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO

from vdet.archives import ArchiveError, list_members, open_archive, read_member
from vdet.config import document
from vdet.errors import ConfigError, ImageError, TruthError
from vdet.files import escaped, printable
from vdet.labels.formats import UNKNOWN, Format, PictureFormat, SourceVideo
from vdet.labels.label import NO_ID, Label, limited
from vdet.labels.parsing import (
    LIMIT,
    MAX_BYTES,
    label_lines,
    parse_number,
    parse_whole,
    read_text,
    text_of,
)
from vdet.labels.pictures import LabelledPicture, pictures_below
from vdet.labels.video import SavedTracks
from vdet.media.images import read_header
from vdet.track.track import FrameTracks, Track

_DATA = "data.yaml"
_NO_LABELS = "classes.txt"  # label tools write it beside the labels
_NUMBER = re.compile(r"([0-9]{1,8})$", re.ASCII)
_COLUMNS = 5

Size = tuple[int, int]
"""Width and height in pixels."""


class YoloWriter:
    """Keeps the labels of each frame, and writes all at the end.

    Boxes end at the sides of the frame; a box that lies outside is left out.
    """

    def __init__(self, file: BinaryIO, video: SourceVideo | None) -> None:
        assert video is not None  # `needs_video` says so
        self._file = file
        self._size = video.width, video.height
        self._classes: dict[str, int] = {}  # name: number, in the order of their numbers
        self._labels: dict[int, str] = {}  # by frame

    def write(self, frame: FrameTracks) -> None:
        """Keep the labels of a frame."""
        self._labels[frame.index] = "".join(self._line(track) for track in frame.tracks)

    def _line(self, track: Track) -> str:
        width, height = self._size
        box = track.box.rounded.clipped(width, height)
        if not box.area:
            return ""
        number = self._classes.setdefault(track.class_name or UNKNOWN, len(self._classes))
        x, y = box.center
        shares = (x / width, y / height, box.width / width, box.height / height)
        return f"{number} {' '.join(f'{share:.6f}' for share in shares)} {track.id}\n"

    def end(self) -> None:
        """Write the whole archive."""
        classes = "".join(
            f"  {number}: {json.dumps(escaped(name), ensure_ascii=False)}\n"
            for name, number in (self._classes or {UNKNOWN: 0}).items()
        )
        size = "width: {}\nheight: {}\n".format(*self._size)
        names = {index: f"frame_{index:06}" for index in self._labels}
        with zipfile.ZipFile(self._file, "w", zipfile.ZIP_DEFLATED) as archive:
            _add(archive, _DATA, f"path: .\ntrain: train.txt\nnames:\n{classes}{size}")
            pictures = "".join(f"images/train/{name}.png\n" for name in names.values())
            _add(archive, "train.txt", pictures)
            for index, labels in self._labels.items():
                _add(archive, f"labels/train/{names[index]}.txt", labels)


def _add(archive: zipfile.ZipFile, name: str, text: str) -> None:
    """Add a file whose date is always the same, so that equal labels give equal archives."""
    info = zipfile.ZipInfo(name)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o644 << 16
    archive.writestr(info, text)


def read_yolo(path: Path, data: bytes) -> SavedTracks:
    """Read the labels of every frame, whose number from 0 stands at the end of its file's name.

    A line may have the score before the id, as Ultralytics writes both.

    Raises
    ------
    TruthError
        The archive is damaged, a name in it leads out of it, its labels are larger than
        `MAX_BYTES`, there is no `data.yaml` with names and the size of the frames, two files are of
        one frame, or a line is not of this form.
    """
    try:
        members = list_members(io.BytesIO(data))
        with open_archive(io.BytesIO(data)) as archive:
            names, size = _described(path, archive, members)
            files = _label_files(path, archive, members)
            texts = {
                index: (name, text_of(path, read_member(archive, name, most=MAX_BYTES)))
                for index, name in sorted(files.items())
            }
    except ArchiveError as error:
        raise TruthError(f"{path}: {error}") from error
    labels = (
        label
        for index, (name, text) in texts.items()
        for label in label_lines(
            path,
            text,
            partial(_label, names=names, size=size, frame=index + 1),
            form="YOLO with tracks",
            counts=(_COLUMNS + 1, _COLUMNS + 2),
            member=printable(name),
        )
    )
    return SavedTracks(tuple(limited(path, labels)), listed=tuple(texts), size=size)


def _described(
    path: Path, archive: zipfile.ZipFile, members: Sequence[str]
) -> tuple[list[str], Size]:
    """Return the names and the size of frames in `data.yaml`, at the top or in a folder."""
    found = [name for name in members if PurePosixPath(name).name == _DATA]
    if not found:
        raise TruthError(f"{path}: needs {_DATA} with the names of the classes")
    first = min(found, key=lambda name: (name.count("/"), name))
    where = f"{path}:{printable(first)}"
    text = text_of(path, read_member(archive, first, most=document.MAX_BYTES))
    values = _values(lambda: document.parse_document(text, where))
    names = _class_names(values, where)
    size = values.get("width"), values.get("height")
    if not all(isinstance(side, int) and 0 < side <= LIMIT for side in size):
        raise TruthError(
            f"{where}: does not say how large the frames are; add the lines 'width: 1280' and "
            "'height: 720' with the pixels of yours"
        )
    return names, size  # type: ignore[return-value]  # checked above


def _values(read: Callable[[], document.Document]) -> Mapping[str, Any]:
    """Return the values of a YAML document that `read` reads."""
    try:
        return read().values
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


def _label_files(path: Path, archive: zipfile.ZipFile, members: Sequence[str]) -> dict[int, str]:
    """Return the names of all files of labels by their frame."""
    files: dict[int, str] = {}
    names = [name for name in members if _is_label_file(PurePosixPath(name))]
    if sum(archive.getinfo(name).file_size for name in names) > MAX_BYTES:
        raise TruthError(f"{path}: its labels are larger than {MAX_BYTES:,} bytes; cut the video")
    for name in names:
        number = _NUMBER.search(PurePosixPath(name).stem)
        if number is None:
            raise TruthError(
                f"{path}: {printable(name)} has no number of a frame at its end, as in "
                "frame_000012.txt"
            )
        other = files.setdefault(int(number[1]), name)
        if other != name:
            both = f"{printable(other)} and {printable(name)}"
            raise TruthError(f"{path}: {both} are of one frame")
    return files


def _is_label_file(name: PurePosixPath) -> bool:
    return name.suffix.lower() == ".txt" and "labels" in name.parts[:-1]


def _label(
    place: int | str, columns: Sequence[str], names: Sequence[str], size: Size, frame: int = 1
) -> Label:
    """Return the label of a line: a box, and with more columns its id, or its score and its id.

    Raises
    ------
    ValueError
        The class has no name, or a number is not between 0 and 1.
    """
    number = parse_whole(columns[0])
    if not 0 <= number < len(names):
        raise ValueError(f"class {number} has no name; {_DATA} has {len(names)} names")
    shares = [parse_number(column) for column in columns[1:_COLUMNS]]
    if not all(0 <= share <= 1 for share in shares):
        raise ValueError("a number is not between 0 and 1; YOLO has shares of the picture")
    x, y, width, height = (share * size[i % 2] for i, share in enumerate(shares))
    return Label(
        place,
        (x - width / 2, y - height / 2, x + width / 2, y + height / 2),
        names[number],
        frame,
        parse_whole(columns[-1]) if len(columns) > _COLUMNS else NO_ID,
        parse_number(columns[_COLUMNS]) if len(columns) > _COLUMNS + 1 else 1.0,
    )


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
    names = _class_names(_values(lambda: document.read_document(data)), str(data))
    images, labels = folder / "images", folder / "labels"
    files = {file for file in labels.rglob("*.txt") if file.name != _NO_LABELS}
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
    labels = label_lines(file, read_text(file), parse, form="YOLO", counts=[_COLUMNS])
    return LabelledPicture(picture, file, tuple(labels), size)


YOLO = Format("YOLO", ".yolo.zip", read_yolo, YoloWriter, needs_video=True)
YOLO_PICTURES = PictureFormat("YOLO", ("images", "labels"), read_yolo_pictures)
