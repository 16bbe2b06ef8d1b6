"""KITTI tracking: columns between spaces; frames and pixels count from 0.

Source: Geiger, Lenz, Urtasun, "Are we ready for autonomous driving?", CVPR 2012, and the readme of
its tracking development kit.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from vdet.labels.parsing import numbered_lines, parse_number, parse_whole, text_of
from vdet.labels.protocol import Format, SourceVideo
from vdet.labels.rows import Row, limited, line_error
from vdet.labels.saved import SavedTracks
from vdet.lanes.road import Road
from vdet.track.track import FrameTracks

_COLUMNS = 17  # and one more for the score of a result
_TYPES = {None: "Car", "car": "Car", "vehicle": "Car", "truck": "Truck", "bus": "Truck"}
"""What our classes are called; there is no bus. All others are Misc."""
_BEFORE = "-1 -1 -10"  # truncated, occluded, alpha: not known
_AFTER = "-1 -1 -1 -1000 -1000 -1000 -10"  # size, place and direction in metres: not known


class KittiWriter:
    """Writes a line for each box: the 17 columns of the format, and the score."""

    def __init__(self, file: BinaryIO, _: SourceVideo | None = None) -> None:
        self._file = file

    def write(self, frame: FrameTracks, road: Road | None = None) -> None:  # noqa: ARG002
        """Add the boxes of a frame."""
        for track in frame.tracks:
            box, name = track.box, _TYPES.get(track.class_name, "Misc")
            corners = f"{box.x:.2f} {box.y:.2f} {box.right:.2f} {box.bottom:.2f}"
            line = f"{frame.index} {track.id} {name} {_BEFORE} {corners} {_AFTER} {track.score:.4f}"
            self._file.write(f"{line}\n".encode())

    def end(self) -> None:
        """Do nothing: all lines are written."""


def read_kitti(path: Path, data: bytes) -> SavedTracks:
    """Read labels, with 17 columns, or results, with a score as column 18.

    Only the columns frame, id, type, left, top, right, bottom and score are used.

    Raises
    ------
    TruthError
        A line has another number of columns than the format or than the first line, or a column is
        not a number.
    """
    return SavedTracks(tuple(limited(path, _rows(path, text_of(path, data)))))


def _rows(path: Path, text: str) -> Iterator[Row]:
    counts: tuple[int, ...] = (_COLUMNS, _COLUMNS + 1)
    for line, content in numbered_lines(text):
        columns = content.split()
        if len(columns) not in counts:
            wanted = " or ".join(str(count) for count in counts)
            what = (
                f"KITTI tracking has {wanted} columns between spaces; this line has {len(columns)}"
            )
            raise line_error(path, line, what)
        counts = (len(columns),)
        try:
            frame, track = parse_whole(columns[0]), parse_whole(columns[1])
            left, top, right, bottom = (parse_number(column) for column in columns[6:10])
            score = parse_number(columns[_COLUMNS]) if len(columns) > _COLUMNS else 1.0
        except ValueError as error:
            raise line_error(path, line, str(error)) from error
        place = left, top, right - left, bottom - top
        yield Row(line, frame + 1, track, *place, score, label=columns[2])


KITTI = Format("KITTI tracking", ".kitti.txt", KittiWriter, read_kitti)
