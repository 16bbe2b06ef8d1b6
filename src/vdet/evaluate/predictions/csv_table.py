"""Tracks as a CSV table: a header, then a row for every track in every frame."""

import csv
import io
from collections.abc import Iterator
from pathlib import Path

from vdet.evaluate.rows import Row, refusal
from vdet.evaluate.text import number, whole

_COLUMNS = ("frame", "time", "id", "x", "y", "width", "height")


def csv_rows(path: Path, text: str) -> Iterator[tuple[Row, float]]:
    """Give every row with its time in seconds; other columns than the known are passed over.

    Raises
    ------
    TruthError
        The header lacks a column, or a row has other columns than the header or is not numbers.
    """
    table = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = next(table, [])
        _check_header(header)
        for cells in table:
            if cells:
                yield _row(table.line_num, header, cells)
    except (ValueError, csv.Error) as error:
        raise refusal(path, max(1, table.line_num), str(error)) from error


def _check_header(header: list[str]) -> None:
    missing = [name for name in _COLUMNS if header.count(name) != 1]
    if missing:
        raise ValueError(f"the header must name each of these columns once: {', '.join(missing)}")


def _row(line: int, header: list[str], cells: list[str]) -> tuple[Row, float]:
    if len(cells) != len(header):
        raise ValueError(f"the header has {len(header)} columns; this line has {len(cells)}")
    cell = dict(zip(header, cells, strict=True))
    x, y, width, height = (number(cell[name]) for name in ("x", "y", "width", "height"))
    row = Row(line, whole(cell["frame"]) + 1, whole(cell["id"]), x, y, width, height)
    return row, number(cell["time"])
