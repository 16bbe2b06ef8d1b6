"""MOTChallenge text: comma-separated columns; frames and pixels count from 1.

Source: Milan et al., "MOT16: A Benchmark for Multi-Object Tracking", 2016, tables 3 and 4.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from vdet.evaluate.rows import Row, refusal
from vdet.evaluate.text import number, numbered_lines, whole

_TRUTH_COLUMNS = (9, 10)
_RESULT_COLUMNS = (10,)


def truth_rows(path: Path, text: str) -> Iterator[Row]:
    """Give the rows of a `gt.txt`: frame, id, left, top, width, height, flag, class, visibility.

    Flag 0 makes an ignore region, 1 a vehicle. The class is not looked at (its numbers differ from
    tool to tool), nor the visibility; the older form with ten columns is read alike.

    Raises
    ------
    TruthError
        Columns too many, too few, not as many as in the first line, or not numbers.
    """
    for line, row, flag in _rows(path, text, _TRUTH_COLUMNS):
        if flag not in {0, 1}:
            raise refusal(path, line, f"the flag (column 7) is {flag:g}; it must be 0 or 1")
        yield Row(line, *row, ignored=flag == 0)


def result_rows(path: Path, text: str) -> Iterator[Row]:
    """Give the rows of tracks: frame, id, left, top, width, height, confidence, -1, -1, -1.

    Raises
    ------
    TruthError
        Columns too many, too few, or not numbers.
    """
    for line, row, confidence in _rows(path, text, _RESULT_COLUMNS):
        yield Row(line, *row, score=confidence)


_Place = tuple[int, int, float, float, float, float]


def _rows(path: Path, text: str, counts: tuple[int, ...]) -> Iterator[tuple[int, _Place, float]]:
    """Give line number, `(frame, id, x, y, width, height)` and the seventh column."""
    for line, content in numbered_lines(text):
        columns = content.split(",")
        if len(columns) not in counts:
            wanted = " or ".join(str(count) for count in counts)
            what = f"MOTChallenge has {wanted} columns between commas; this line has {len(columns)}"
            raise refusal(path, line, what)
        counts = (len(columns),)
        try:
            yield line, _place(columns), _numbers(columns[6:])[0]
        except ValueError as error:
            raise refusal(path, line, str(error)) from error


def _place(columns: Sequence[str]) -> _Place:
    left, top, width, height = _numbers(columns[2:6])
    return whole(columns[0]), whole(columns[1]), left - 1, top - 1, width, height


def _numbers(columns: Sequence[str]) -> list[float]:
    return [number(column) for column in columns]
