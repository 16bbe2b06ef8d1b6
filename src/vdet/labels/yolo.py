"""YOLO with tracks: a zip file with a text file of labels for each frame, and `data.yaml`.

A line is the number of a class, x and y of the middle, width and height of the box as shares of the
frame, and the id. The standard form has no id; Ultralytics writes it at the end of the line when it
tracks, and so does CVAT ("Ultralytics YOLO Detection Track"). `data.yaml` has the names of the
classes, and here also `width` and `height` of the frames in pixels, which others pass over.
Source: docs.ultralytics.com, "Object detection datasets overview"; the CVAT manual, "Ultralytics
YOLO".
"""

import io
import json
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO

from vdet.archives import ArchiveError, list_members, open_archive, read_member
from vdet.config import document
from vdet.errors import ConfigError, TruthError
from vdet.files import escaped, printable
from vdet.labels.parsing import (
    LIMIT,
    MAX_BYTES,
    numbered_lines,
    parse_number,
    parse_whole,
    text_of,
)
from vdet.labels.protocol import UNKNOWN, Format, SourceVideo
from vdet.labels.rows import Row, limited, line_error
from vdet.labels.saved import SavedTracks
from vdet.lanes.road import Road
from vdet.track.track import FrameTracks, Track

DATA = "data.yaml"
"""The file with the names of the classes."""

_NUMBER = re.compile(r"([0-9]{1,8})$", re.ASCII)
_COLUMNS = 6


class YoloWriter:
    """Keeps the labels of each frame, and writes all at the end.

    Boxes end at the sides of the frame; a box that lies outside is left out.
    """

    def __init__(self, file: BinaryIO, video: SourceVideo | None) -> None:
        assert video is not None  # `needs_video` says so
        self._file = file
        self._video = video
        self._classes: dict[str, int] = {}  # name: number, in the order of their numbers
        self._labels: dict[int, str] = {}  # by frame

    def write(self, frame: FrameTracks, road: Road | None = None) -> None:  # noqa: ARG002
        """Keep the labels of a frame."""
        self._labels[frame.index] = "".join(self._line(track) for track in frame.tracks)

    def _line(self, track: Track) -> str:
        width, height = self._video.width, self._video.height
        box = track.box.clipped(width, height)
        if not box.area:
            return ""
        number = self._classes.setdefault(track.class_name or UNKNOWN, len(self._classes))
        x, y = box.center
        shares = (x / width, y / height, box.width / width, box.height / height)
        return f"{number} {' '.join(f'{share:.6f}' for share in shares)} {track.id}\n"

    def end(self) -> None:
        """Write the whole archive."""
        lines = ["path: .", "train: train.txt", "names:"]
        for name, number in (self._classes or {UNKNOWN: 0}).items():
            lines.append(f"  {number}: {json.dumps(escaped(name), ensure_ascii=False)}")
        lines += [f"width: {self._video.width}", f"height: {self._video.height}"]
        names = {index: f"frame_{index:06}" for index in self._labels}
        with zipfile.ZipFile(self._file, "w", zipfile.ZIP_DEFLATED) as archive:
            _add(archive, DATA, "".join(f"{line}\n" for line in lines))
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


@dataclass(frozen=True, slots=True)
class _Frames:
    """What `data.yaml` says."""

    names: list[str]
    size: tuple[int, int]


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
            frames = _frames(path, archive, members)
            files = _label_files(path, archive, members)
            texts = {
                index: (name, text_of(path, read_member(archive, name, most=MAX_BYTES)))
                for index, name in sorted(files.items())
            }
    except ArchiveError as error:
        raise TruthError(f"{path}: {error}") from error
    return SavedTracks(
        tuple(limited(path, _rows(path, texts, frames))), listed=tuple(texts), size=frames.size
    )


def _frames(path: Path, archive: zipfile.ZipFile, members: Sequence[str]) -> _Frames:
    """Return what `data.yaml`, at the top or in a folder, says."""
    found = sorted(
        (name for name in members if PurePosixPath(name).name == DATA),
        key=lambda name: (name.count("/"), name),
    )
    if not found:
        raise TruthError(f"{path}: needs {DATA} with the names of the classes")
    where = f"{path}:{printable(found[0])}"
    text = text_of(path, read_member(archive, found[0], most=document.MAX_BYTES))
    try:
        values = document.parse_document(text, where).values
    except ConfigError as error:
        raise TruthError(str(error).splitlines()[0]) from error
    names = class_names(values, where)
    width, height = values.get("width"), values.get("height")
    if not (isinstance(width, int) and isinstance(height, int)):
        raise TruthError(
            f"{where}: does not say how large the frames are; add the lines 'width: 1280' and "
            "'height: 720' with the pixels of yours"
        )
    if not (0 < width <= LIMIT and 0 < height <= LIMIT):
        raise TruthError(f"{where}: {width}×{height} pixels is no size of frames")
    return _Frames(names, (width, height))


def class_names(values: Mapping[str, Any], where: str) -> list[str]:
    """Return `names` of the values of `data.yaml`, a list or numbered. Raises `TruthError`."""
    names = values.get("names")
    if isinstance(names, dict):  # number: name
        names = [names.get(str(number)) for number in range(len(names))]
    if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
        raise TruthError(
            f"{where}: names must be a list of the names of all classes, or number them"
        )
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


def _rows(path: Path, texts: Mapping[int, tuple[str, str]], frames: _Frames) -> Iterator[Row]:
    for index, (name, text) in texts.items():
        for line, content in numbered_lines(text):
            place = f"{printable(name)}:{line}"
            try:
                yield _row(place, index, content.split(), frames)
            except ValueError as error:
                raise line_error(path, place, str(error)) from error


def _row(place: str, index: int, columns: list[str], frames: _Frames) -> Row:
    if len(columns) not in {_COLUMNS, _COLUMNS + 1}:
        raise ValueError(
            f"a label of a track has {_COLUMNS} columns: class, x, y, width, height, id; this line "
            f"has {len(columns)}"
        )
    score = parse_number(columns[5]) if len(columns) > _COLUMNS else 1.0
    label, box = yolo_box(columns[:5], frames.names, frames.size)
    return Row(place, index + 1, parse_whole(columns[-1]), *box, score=score, label=label)


def yolo_box(
    columns: Sequence[str], names: Sequence[str], size: tuple[int, int]
) -> tuple[str, tuple[float, float, float, float]]:
    """Return the class of a label, and x, y, width and height of its box in pixels from 0.

    Parameters
    ----------
    columns
        Number of the class, x and y of the middle, width and height as shares of the picture.
    names
        Of the classes.
    size
        Width and height of the picture in pixels.

    Raises
    ------
    ValueError
        The class has no name, or a number is not between 0 and 1.
    """
    number = parse_whole(columns[0])
    if not 0 <= number < len(names):
        raise ValueError(f"class {number} has no name; {DATA} has {len(names)} names")
    shares = [parse_number(column) for column in columns[1:]]
    if not all(0 <= share <= 1 for share in shares):
        raise ValueError("a number is not between 0 and 1; YOLO has shares of the picture")
    x, y, width, height = (share * size[i % 2] for i, share in enumerate(shares))
    return names[number], (x - width / 2, y - height / 2, width, height)


YOLO = Format("YOLO", ".yolo.zip", YoloWriter, read_yolo, needs_video=True)
