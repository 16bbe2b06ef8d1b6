"""Labels in YOLO form: `images`, `labels` with a text file for each, names in `data.yaml`."""

from collections.abc import Iterator
from pathlib import Path

from vdet.config.document import read_document
from vdet.errors import ConfigError, ImageError, TruthError
from vdet.evaluate.images.folders import pictures_below
from vdet.evaluate.images.labelled import ImageLabels, Label
from vdet.evaluate.labelled_video import line_error
from vdet.evaluate.parsing import numbered_lines, parse_number, parse_whole, read_text
from vdet.media.images import read_size

_NAMES = "data.yaml"
_NO_LABELS = "classes.txt"
"""A file that label tools write beside the labels."""


def yolo_labels(folder: Path) -> Iterator[ImageLabels]:
    """Yield every picture below `images`; one without a file in `labels` shows no vehicle.

    A line is the number of a class, and x and y of the middle, width and height of the box as
    shares of the picture. `names` of `data.yaml`, in the folder or above it, has the classes.
    Source: docs.ultralytics.com, "Object detection datasets overview".

    Raises
    ------
    TruthError
        There are no names, a file of labels has no picture, a line is not of this form, or the
        size of a labelled picture cannot be read.
    """
    names = _class_names(folder)
    images, labels = folder / "images", folder / "labels"
    files = {file for file in labels.rglob("*.txt") if file.name != _NO_LABELS}
    for picture in pictures_below(images):
        file = labels / picture.relative_to(images).with_suffix(".txt")
        if file in files:
            files.remove(file)
            yield _labelled(picture, file, names)
        else:
            yield ImageLabels(picture, ())
    if files:
        raise TruthError(f"{min(files)}: has no picture of its name below {images}")


def _class_names(folder: Path) -> list[str]:
    path = next((p for p in (folder / _NAMES, folder.parent / _NAMES) if p.is_file()), None)
    if path is None:
        raise TruthError(f"{folder}: needs {_NAMES} with the names of the classes, here or above")
    try:
        names = read_document(path).values.get("names")
    except ConfigError as error:
        raise TruthError(str(error).splitlines()[0]) from error
    if isinstance(names, dict):  # number: name
        names = [names.get(str(number)) for number in range(len(names))]
    if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
        raise TruthError(
            f"{path}: names must be a list of the names of all classes, or number them"
        )
    return names


def _labelled(picture: Path, file: Path, names: list[str]) -> ImageLabels:
    try:
        size = read_size(picture)
    except ImageError as error:
        raise TruthError(str(error)) from error
    lines = numbered_lines(read_text(file))
    return ImageLabels(
        picture, tuple(_label(file, line, text, names, size) for line, text in lines), size
    )


def _label(file: Path, line: int, text: str, names: list[str], size: tuple[int, int]) -> Label:
    columns = text.split()
    try:
        if len(columns) != 5:
            raise ValueError(f"YOLO has 5 columns between spaces; this line has {len(columns)}")
        number = parse_whole(columns[0])
        if not 0 <= number < len(names):
            raise ValueError(f"class {number} has no name; {_NAMES} has {len(names)} names")
        shares = [parse_number(column) for column in columns[1:]]
        if not all(0 <= share <= 1 for share in shares):
            raise ValueError("a number is not between 0 and 1; YOLO has shares of the picture")
    except ValueError as error:
        raise line_error(file, line, str(error)) from error
    x, y, width, height = (share * size[i % 2] for i, share in enumerate(shares))
    return Label(f"{file}:{line}", names[number], x - width / 2, y - height / 2, width, height)
