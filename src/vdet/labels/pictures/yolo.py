"""Labels in YOLO form: `images`, `labels` with a text file for each, names in `data.yaml`."""

from collections.abc import Iterator
from pathlib import Path

from vdet.config.document import read_document
from vdet.errors import ConfigError, ImageError, TruthError
from vdet.labels.parsing import numbered_lines, read_text
from vdet.labels.pictures.folders import pictures_below
from vdet.labels.pictures.labelled import ImageLabels, Label
from vdet.labels.rows import line_error
from vdet.labels.yolo import DATA, class_names, yolo_box
from vdet.media.images import read_header

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
    path = next((p for p in (folder / DATA, folder.parent / DATA) if p.is_file()), None)
    if path is None:
        raise TruthError(f"{folder}: needs {DATA} with the names of the classes, here or above")
    try:
        values = read_document(path).values
    except ConfigError as error:
        raise TruthError(str(error).splitlines()[0]) from error
    return class_names(values, str(path))


def _labelled(picture: Path, file: Path, names: list[str]) -> ImageLabels:
    try:
        size, _ = read_header(picture)
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
        name, box = yolo_box(columns, names, size)
    except ValueError as error:
        raise line_error(file, line, str(error)) from error
    return Label(f"{file}:{line}", name, *box)
