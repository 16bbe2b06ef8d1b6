"""YOLO: a text file of labels for each image, and `data.yaml` with the classes.

A line has the number of a class, and the centre (x, y), width and height of the box as fractions of
the image, or the points of a polygon. Source: docs.ultralytics.com, "Object detection datasets
overview".
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from vdet.boxes import Box
from vdet.config.loading import parse_document
from vdet.errors import ConfigError, ImageError, TruthError
from vdet.files import is_hidden
from vdet.labels.images import LabelledImage
from vdet.labels.label import NO_ID, Label, Size, line_error
from vdet.labels.parsing import numbered_lines, read_bytes
from vdet.media.images import is_image_name, read_header
from vdet.track.track import Track

_DATA = "data.yaml"
_COLUMNS = 5
_MIN_POLYGON = 7  # columns: the class and three points


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


def _labels(path: Path, names: Mapping[float, str], size: Size) -> Iterator[Label]:
    """Yield the label of each line: a box, or a polygon with three points or more, as its box.

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
        yield Label(Track(NO_ID, Box(x1, y1, x2, y2), 1.0, "detected", name), line)


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
