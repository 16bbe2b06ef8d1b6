"""Labelled images, the files that a label file names, and the format YOLO.

YOLO has a text file of labels for each image, and `data.yaml` with the classes. A line has the
number of a class, and the centre (x, y), width and height of the box as fractions of the image, or
the points of a polygon. Source: docs.ultralytics.com, "Object detection datasets overview".
"""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, unquote_plus

import numpy as np

from vdet.boxes import Box, Image
from vdet.config.loading import parse_document
from vdet.errors import ConfigError, ImageError, TruthError, printable
from vdet.files import is_hidden
from vdet.labels.label import NO_ID, Size, line_error, numbered_lines, read_bytes
from vdet.media.images import is_image_name, read_header, read_image
from vdet.track.track import Track

_DATA = "data.yaml"
_COLUMNS = 5
_MIN_POLYGON = 7  # columns: the class and three points


@dataclass(frozen=True, slots=True)
class LabelledImage:
    """An image with its labels.

    Attributes
    ----------
    path, file
        The image file, and the file of its labels.
    labels
        From a reader: all labels of the file. In `LabelledImages`: only vehicles and ignore
        regions, each with an area, named by a class of `Roles`.
    size
        Width and height of the image in pixels; None if the labels do not contain them.
    unlabelled
        Classes that are not labelled although the image may show them.
    """

    path: Path
    file: Path
    labels: tuple[Track, ...] = ()
    size: Size | None = None
    unlabelled: tuple[str, ...] = ()

    def read(self) -> Image:
        """Read the image, BGR uint8 `(H, W, 3)`.

        Raises
        ------
        ImageError
            It cannot be read, or its size differs from that in its labels.
        """
        image = read_image(self.path)
        height, width = image.shape[:2]
        if self.size not in (None, (width, height)):
            labelled = f"{self.size[0]}×{self.size[1]}"
            raise ImageError(f"{self.path}: is {width}×{height}, but its labels are for {labelled}")
        return image


@dataclass(frozen=True, slots=True)
class LabelledImages:
    """Labelled images of one source.

    `name` is shown in tables. `omitted` are labels that are neither vehicles nor ignore regions,
    whose boxes are omitted; `ignored` are the labels of ignore regions. Both have the number of
    boxes of each label, the most frequent first.
    """

    name: str
    images: tuple[LabelledImage, ...]
    omitted: Mapping[str, int] = field(default_factory=dict)
    ignored: Mapping[str, int] = field(default_factory=dict)


def is_file(path: Path) -> bool:
    """Return whether a file exists; False if its name is too long."""
    return os.path.isfile(path)  # noqa: PTH113  # the method of `Path` raises


def inside_set(name: str) -> str:
    """Return an image name from a file. Raises `ValueError` if it points outside the set."""
    if ".." in PurePosixPath(name.replace("\\", "/")).parts:
        raise ValueError(f"{printable(name)} points outside the set")
    return name


def image_names(path: Path, names: Sequence[str]) -> list[Path]:
    """Return the paths of the images that a file of labels names.

    If not all are found by these names, they may be addresses (`a%20b.jpg`, `a+b.jpg`), and then
    only their last parts are used, such as `a.jpg` of `/data/upload/1/a.jpg` or
    `/data/?d=images/a.jpg`; a backslash separates folders, too. Raises `TruthError` if no folder
    has the first image, or several have.
    """
    addresses = [name.rpartition("?d=")[2].partition("?")[0] for name in names]
    decoded = [list(map(decode, addresses)) for decode in (unquote, unquote_plus)]
    last_parts = [[re.split(r"[/\\]", name)[-1] for name in item] for item in (addresses, *decoded)]
    for spelled in (names, *decoded, *last_parts) if names else ():
        if len(set(spelled)) == len(set(names)):
            with suppress(TruthError):
                folder = image_folder(path, spelled)
                paths = [folder / name for name in spelled]
                if all(map(is_file, paths)):
                    return paths
    return [image_folder(path, names) / name for name in names]


def image_folder(path: Path, names: Sequence[str]) -> Path:
    """Return the folder that image names are relative to: the one that has the first image.

    It is the folder of the label file or at most two folders below; if the file is in
    `annotations`, below the parent folder. Raises `TruthError` if there is none or several, or a
    name is absolute or points outside the set.
    """
    if any(name.startswith("/") or ".." in PurePosixPath(name).parts for name in names):
        raise TruthError(f"{path}: has absolute names of images; make them relative")
    name = names[0]
    near, shown = path.parent, printable(name)
    above = near.parent if near.name == "annotations" else near
    for level in ([near], [above], sorted(above.glob("*/")), sorted(above.glob("*/*/"))):
        folders = [folder for folder in level if is_file(folder / name)]
        if len(folders) > 1:
            both = " and ".join(str(folder) for folder in folders[:2])
            raise TruthError(f"{path}: its first image, {shown}, is in {both}; keep one")
        if folders:
            return folders[0]
    raise TruthError(f"{path}: its first image, {shown}, was not found beside it or below")


def _class_names(path: Path) -> dict[float, str]:
    """Return the names of the classes in `data.yaml` by their numbers."""
    try:
        values = parse_document(read_bytes(path).decode("utf-8-sig", "replace"), str(path)).values
    except ConfigError as error:
        raise TruthError(error.args[0]) from error
    names = values.get("names")
    if isinstance(names, dict):  # number: name
        names = [names.get(str(number)) for number in range(len(names))]
    if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
        raise TruthError(f"{path}: names must be a list with all classes, or number them from 0")
    return {float(number): name for number, name in enumerate(names)}


def _labels(path: Path, names: Mapping[float, str], size: Size) -> Iterator[Track]:
    """Yield the box of each line: a box, or a polygon with three points or more, as its box.

    Points less than a pixel outside the image are moved to its side.
    """
    for line, content in numbered_lines(path, read_bytes(path)):
        try:
            number, *fractions = map(float, content.split())
        except ValueError as error:
            raise line_error(path, line, str(error)) from error
        count = 1 + len(fractions)
        if count != _COLUMNS and (count < _MIN_POLYGON or count % 2 == 0):
            message = f"{_COLUMNS} columns, or the points of a polygon; this line has {count}"
            raise line_error(path, line, f"YOLO has {message}")
        name = names.get(number)
        if name is None:
            message = f"class {number:g} has no name; {_DATA} has {len(names)} names"
            raise line_error(path, line, message)
        points = np.array(fractions).reshape(-1, 2) * size
        if not np.all((points >= -1) & (points <= np.add(size, 1))):
            message = "a number is not between 0 and 1; YOLO uses fractions of the image"
            raise line_error(path, line, message)
        points = points.clip(0, size)
        if count == _COLUMNS:
            middle, sides = points
            points = np.array([middle - sides / 2, middle + sides / 2])
        (x1, y1), (x2, y2) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        yield Track(NO_ID, Box(x1, y1, x2, y2), 1.0, "detected", name, position=line)


def read_yolo_images(images: Path, labels: Path) -> Iterator[LabelledImage]:
    """Yield the images of a set; one without a label file of its name shows no vehicle.

    Hidden files and files of the system or of label tools are skipped.

    Raises
    ------
    TruthError
        `data.yaml` is missing in the folder of the set and above it, an image cannot be read, a
        line is invalid, or, at the end, a label file has no image of its name.
    """
    folder = images.parent
    data = next((p for p in (folder / _DATA, folder.parent / _DATA) if p.is_file()), None)
    if data is None:
        raise TruthError(f"{folder}: needs {_DATA} with the names of the classes, here or above")
    names = _class_names(data)
    files = {
        file.relative_to(labels).with_suffix(""): file
        for file in labels.rglob("*.txt")
        if file.is_file()  # a FIFO may never end
        and not is_hidden(file.relative_to(labels))
        and file.name != "classes.txt"
    }
    for image in sorted(filter(is_image_name, images.rglob("*"))):
        file = files.pop(image.relative_to(images).with_suffix(""), None)
        if file is None:
            yield LabelledImage(image, image)
            continue
        try:
            size, _ = read_header(image)
        except ImageError as error:
            raise TruthError(str(error)) from error
        yield LabelledImage(image, file, tuple(_labels(file, names, size)), size)
    if files:
        raise TruthError(f"{min(files.values())}: has no image of its name below {images}")
