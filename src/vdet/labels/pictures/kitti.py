"""Labels in KITTI form: `image_2` with pictures, and `label_2` with a text file for each."""

from collections.abc import Iterator
from pathlib import Path

from vdet.labels.parsing import numbered_lines, parse_number, read_text
from vdet.labels.pictures.folders import labelled_pairs
from vdet.labels.pictures.labelled import ImageLabels, Label
from vdet.labels.rows import line_error

_COLUMNS = 15


def kitti_labels(folder: Path) -> Iterator[ImageLabels]:
    """Yield every picture that has a file in `label_2`.

    A line has 15 columns separated by spaces, of which type, left, top, right and bottom are used.
    Car and Van are cars, Truck is a truck, also where they are hidden or cut off; DontCare, Tram
    and Misc are ignore regions; Pedestrian, Person_sitting and Cyclist are left out.
    Source: Geiger, Lenz, Urtasun, "Are we ready for autonomous driving?", CVPR 2012, and the readme
    of its object development kit.

    Raises
    ------
    TruthError
        A file has no picture, a line another number of columns, or a column is not a number.
    """
    for file, picture in labelled_pairs(folder / "label_2", ".txt", folder / "image_2"):
        lines = numbered_lines(read_text(file))
        yield ImageLabels(picture, tuple(_label(file, line, text) for line, text in lines))


def _label(file: Path, line: int, text: str) -> Label:
    columns = text.split()
    if len(columns) != _COLUMNS:
        what = f"KITTI has {_COLUMNS} columns between spaces; this line has {len(columns)}"
        raise line_error(file, line, what)
    try:
        left, top, right, bottom = (parse_number(column) for column in columns[4:8])
    except ValueError as error:
        raise line_error(file, line, str(error)) from error
    return Label(f"{file}:{line}", columns[0], left, top, right - left, bottom - top)
