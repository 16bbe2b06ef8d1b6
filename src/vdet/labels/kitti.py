"""KITTI: labels of images, with space-separated columns; pixels count from 0.

Source: Geiger, Lenz, Urtasun, "Are we ready for autonomous driving?", CVPR 2012, and the readme of
its development kit for objects.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from vdet.labels.images import LabelledImage, paired_files
from vdet.labels.label import Label
from vdet.labels.parsing import label_lines, parse_number, read_bytes


def read_kitti_images(images: Path, labels: Path) -> Iterator[LabelledImage]:
    """Yield the images of a set that have a label file, with 15 columns per line.

    Only the columns type, left, top, right and bottom are used.

    Raises
    ------
    TruthError
        A line has another number of columns, a column is not a number, or as for `paired_files`.
    """
    for image, file in paired_files(images, labels):
        if file:
            rows = label_lines(file, read_bytes(file), _label, form="KITTI", counts=[15])
            yield LabelledImage(image, file, tuple(rows))


def _label(line: int, columns: Sequence[str]) -> Label:
    left, top, right, bottom = map(parse_number, columns[4:8])
    return Label(line, (left, top, right, bottom), columns[0])
