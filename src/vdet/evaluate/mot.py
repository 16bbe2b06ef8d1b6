"""MOTChallenge text: comma-separated columns; frames and pixels count from 1.

Source: Milan et al., "MOT16: A Benchmark for Multi-Object Tracking", 2016, tables 3 and 4.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from vdet.evaluate.labelled_video import Row, line_error
from vdet.evaluate.parsing import numbered_lines, parse_number, parse_whole

_TRUTH_COLUMNS = (9, 10)
_RESULT_COLUMNS = (10,)


def truth_rows(path: Path, text: str) -> Iterator[Row]:
    """Yield the rows of a `gt.txt`: frame, id, left, top, width, height, flag, class, visibility.

    Flag 0 marks an ignore region, 1 a vehicle. The class is not used, because its numbers differ
    from tool to tool; neither is the visibility. The older form with ten columns is read too.

    Raises
    ------
    TruthError
        A line has another number of columns than the format or than the first line, or a column is
        not a number.
    """
    for line, place, flag in _rows(path, text, _TRUTH_COLUMNS):
        if flag not in {0, 1}:
            raise line_error(path, line, f"the flag (column 7) is {flag:g}; it must be 0 or 1")
        yield Row(line, *place, ignored=flag == 0)


def result_rows(path: Path, text: str) -> Iterator[Row]:
    """Yield the rows of tracks: frame, id, left, top, width, height, confidence, -1, -1, -1.

    Raises
    ------
    TruthError
        A line does not have ten columns, or a column is not a number.
    """
    for line, place, confidence in _rows(path, text, _RESULT_COLUMNS):
        yield Row(line, *place, score=confidence)


_Place = tuple[int, int, float, float, float, float]


def _rows(path: Path, text: str, counts: tuple[int, ...]) -> Iterator[tuple[int, _Place, float]]:
    """Yield line number, `(frame, id, x, y, width, height)` and the seventh column."""
    for line, content in numbered_lines(text):
        columns = content.split(",")
        if len(columns) not in counts:
            wanted = " or ".join(str(count) for count in counts)
            what = f"MOTChallenge has {wanted} columns between commas; this line has {len(columns)}"
            raise line_error(path, line, what)
        counts = (len(columns),)
        try:
            seventh, *_ = [parse_number(column) for column in columns[6:]]
            yield line, _place(columns), seventh
        except ValueError as error:
            raise line_error(path, line, str(error)) from error


def _place(columns: Sequence[str]) -> _Place:
    left, top, width, height = (parse_number(column) for column in columns[2:6])
    return parse_whole(columns[0]), parse_whole(columns[1]), left - 1, top - 1, width, height
