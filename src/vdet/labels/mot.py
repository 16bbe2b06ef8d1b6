"""MOTChallenge text: comma-separated columns; frames and pixels count from 1.

Source: Milan et al., "MOT16: A Benchmark for Multi-Object Tracking", 2016, tables 3 and 4.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

from vdet.labels.parsing import numbered_lines, parse_number, parse_whole, text_of
from vdet.labels.protocol import Format, SourceVideo
from vdet.labels.rows import Row, limited, line_error
from vdet.labels.saved import SavedTracks
from vdet.lanes.road import Road
from vdet.track.track import FrameTracks

_TRUTH_COLUMNS, _RESULT_COLUMNS = 9, 10


class MotWriter:
    """Writes a line for each box: frame, id, left, top, width, height, score, -1, -1, -1."""

    def __init__(self, file: BinaryIO, _: SourceVideo | None = None) -> None:
        self._file = file

    def write(self, frame: FrameTracks, road: Road | None = None) -> None:  # noqa: ARG002
        """Add the boxes of a frame."""
        for track in frame.tracks:
            box = track.box
            place = f"{box.x + 1},{box.y + 1},{box.width},{box.height}"
            line = f"{frame.index + 1},{track.id},{place},{track.score:.4f},-1,-1,-1\n"
            self._file.write(line.encode())

    def end(self) -> None:
        """Do nothing: all lines are written."""


def read_mot(path: Path, data: bytes) -> SavedTracks:
    """Read results or truth.

    Results have ten columns: frame, id, left, top, width, height, confidence, -1, -1, -1. Truth has
    nine, as in `gt.txt`: frame, id, left, top, width, height, flag, class, visibility. Flag 0 marks
    an ignore region, 1 a vehicle. The class is not used, because its numbers differ from tool to
    tool; neither is the visibility.

    Raises
    ------
    TruthError
        A line has another number of columns than the format or than the first line, a column is
        not a number, or a flag is neither 0 nor 1.
    """
    return SavedTracks(tuple(limited(path, _rows(path, text_of(path, data)))))


def flagged(path: Path, row: Row) -> Row:
    """Return a row of ten columns as truth of the older form, in which column 7 is the flag.

    Raises
    ------
    TruthError
        The flag is neither 0 nor 1.
    """
    if row.score not in {0, 1}:
        raise line_error(path, row.line, _flag_mistake(row.score))
    place = row.line, row.frame, row.id, row.x, row.y, row.width, row.height
    return Row(*place, ignored=row.ignored or row.score == 0)


def _flag_mistake(flag: float) -> str:
    return f"the flag (column 7) is {flag:g}; it must be 0 or 1"


def _rows(path: Path, text: str) -> Iterator[Row]:
    counts: tuple[int, ...] = (_TRUTH_COLUMNS, _RESULT_COLUMNS)
    for line, content in numbered_lines(text):
        columns = content.split(",")
        if len(columns) not in counts:
            wanted = " or ".join(str(count) for count in counts)
            what = f"MOTChallenge has {wanted} columns between commas; this line has {len(columns)}"
            raise line_error(path, line, what)
        counts = (len(columns),)
        try:
            yield _row(line, columns)
        except ValueError as error:
            raise line_error(path, line, str(error)) from error


def _row(line: int, columns: Sequence[str]) -> Row:
    seventh, *_ = [parse_number(column) for column in columns[6:]]
    left, top, width, height = (parse_number(column) for column in columns[2:6])
    frame, track = parse_whole(columns[0]), parse_whole(columns[1])
    if len(columns) == _RESULT_COLUMNS:
        return Row(line, frame, track, left - 1, top - 1, width, height, score=seventh)
    if seventh not in {0, 1}:
        raise ValueError(_flag_mistake(seventh))
    return Row(line, frame, track, left - 1, top - 1, width, height, ignored=seventh == 0)


MOT = Format("MOTChallenge", ".txt", MotWriter, read_mot)
