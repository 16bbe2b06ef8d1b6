"""YOLO: a text file of labels for each image, and `data.yaml` with the classes.

A line has the number of a class, and the centre (x, y), width and height of the box as fractions of
the image, or the points of a polygon. Source: docs.ultralytics.com, "Object detection datasets
overview".
"""

import json
import zipfile
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import BinaryIO

from vdet.archives import store
from vdet.boxes import Box
from vdet.config.classes import UNKNOWN
from vdet.config.document import MAX_BYTES as MAX_DESCRIPTION
from vdet.config.document import parse_document
from vdet.errors import ConfigError, ImageError, OutputError, TruthError, escaped
from vdet.labels.formats import Format, ImageTracks
from vdet.labels.images import LabelledImage, paired_files
from vdet.labels.label import Label, SavedTracks, Size
from vdet.labels.parsing import label_lines, parse_number, parse_whole, read_bytes
from vdet.media.images import read_header

_DATA = "data.yaml"
_COLUMNS = 5
_MIN_POLYGON = 7  # columns: the class and three points


def _write_images(file: BinaryIO, images: Sequence[ImageTracks]) -> None:
    """Write the archive, to be unpacked beside the folder `images`."""
    classes: dict[str, int] = {}  # name: number, in the order of their numbers
    texts: dict[str, str] = {}
    for image in images:
        name = f"labels/{image.path.with_suffix('.txt').as_posix()}"
        if name in texts:
            raise OutputError(
                f"{image.path.with_suffix('')}: YOLO needs images with different names; this one "
                "occurs with two endings"
            )
        lines = (_line(t.box, t.class_name, image.size, classes) for t in image.tracks)
        texts[name] = "".join(lines)
    names = json.dumps([escaped(name) for name in classes] or [UNKNOWN], ensure_ascii=False)
    # Ultralytics needs both `train` and `val`.
    texts[_DATA] = f"path: .\ntrain: images\nval: images\nnames: {names}\n"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in texts.items():
            store(archive, name, text)


def _line(box: Box, name: str | None, size: Size, classes: dict[str, int]) -> str:
    """Return the line of a box, and number its class."""
    width, height = size
    box = box.rounded.clipped(width, height)
    if not box.area:
        return ""
    number = classes.setdefault(name or UNKNOWN, len(classes))
    x, y = box.center
    ratios = (x / width, y / height, box.width / width, box.height / height)
    return f"{number} {' '.join(f'{ratio:.6f}' for ratio in ratios)}\n"


def _reject_tracks(path: Path, _: bytes) -> SavedTracks:
    raise TruthError(f"{path}: a zip file of YOLO has no tracks; save or export them as COCO")


def _class_names(data: bytes, where: str) -> list[str]:
    """Return the names of the classes in `data.yaml`, the file `where`."""
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
    return names


def _label(line: int, columns: Sequence[str], names: Sequence[str], size: Size) -> Label:
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
    return Label(line, (min(xs), min(ys), max(xs), max(ys)), names[number])


def _pixels(text: str, side: int) -> float:
    """Return a fraction of a side of the frame in pixels. Raises ValueError."""
    pixels = parse_number(text) * side
    if not -1 <= pixels <= side + 1:
        raise ValueError("a number is not between 0 and 1; YOLO uses fractions of the image")
    return min(max(pixels, 0.0), float(side))


def read_yolo_images(images: Path, labels: Path) -> Iterator[LabelledImage]:
    """Yield the images of a set; one without a label file shows no vehicle.

    Raises
    ------
    TruthError
        `data.yaml` is missing in the folder of the set and above it, an image cannot be read, a
        line is invalid, or as for `paired_files`.
    """
    folder = images.parent
    data = next((p for p in (folder / _DATA, folder.parent / _DATA) if p.is_file()), None)
    if data is None:
        raise TruthError(f"{folder}: needs {_DATA} with the names of the classes, here or above")
    names = _class_names(read_bytes(data), str(data))
    for image, file in paired_files(images, labels):
        if file is None:
            yield LabelledImage(image, image)
            continue
        try:
            size, _ = read_header(image)
        except ImageError as error:
            raise TruthError(str(error)) from error
        parse = partial(_label, names=names, size=size)
        label_rows = label_lines(file, read_bytes(file), parse, form="YOLO", counts=None)
        yield LabelledImage(image, file, tuple(label_rows), size)


YOLO = Format("YOLO", ".yolo.zip", _reject_tracks, images=_write_images)
