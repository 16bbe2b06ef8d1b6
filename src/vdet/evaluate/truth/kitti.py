"""KITTI tracking labels: 17 columns separated by spaces; frames and pixels count from 0.

Source: Geiger, Lenz, Urtasun, "Are we ready for autonomous driving?", CVPR 2012, and the readme of
its tracking development kit.
"""

from collections.abc import Iterator
from pathlib import Path

from vdet.evaluate.rows import Row, refusal
from vdet.evaluate.text import number, numbered_lines, whole
from vdet.evaluate.truth.labels import Role, role_of

_COLUMNS = 17


def kitti_rows(path: Path, text: str) -> Iterator[Row]:
    """Give the vehicles and ignore regions of a label file.

    Car, Van and Truck are vehicles however hidden or cut off; DontCare, Tram and Misc are ignore
    regions; Pedestrian, Person and Cyclist are passed over. Of the columns only frame, id, type,
    left, top, right and bottom are used.

    Raises
    ------
    TruthError
        Columns too many, too few or not numbers, or an unknown type.
    """
    for line, content in numbered_lines(text):
        columns = content.split()
        if len(columns) != _COLUMNS:
            what = f"KITTI tracking has 17 columns between spaces; this line has {len(columns)}"
            raise refusal(path, line, what)
        try:
            row = _row(line, columns)
        except ValueError as error:
            raise refusal(path, line, str(error)) from error
        if row is not None:
            yield row


def _row(line: int, columns: list[str]) -> Row | None:
    frame, track, role = whole(columns[0]), whole(columns[1]), role_of(columns[2])
    left, top, right, bottom = (number(column) for column in columns[6:10])
    if role is Role.OTHER:
        return None
    ignored = role is Role.IGNORED
    return Row(line, frame + 1, track, left, top, right - left, bottom - top, ignored=ignored)
