"""Tables and JSON files of one video or several; with several, the video is the first column."""

import csv
import re
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from vdet.errors import TruthError, needing
from vdet.files import json_text, valid_text, write_text

SUFFIXES = (".csv", ".json", ".parquet")

VIDEO = "video"
"""The column with the name of the video."""
_TEXTS = (VIDEO, "class", "clock", "motion")
"""Columns of text in Parquet."""
_INTEGERS = ("id", "detected", "interpolated", "predicted", "x", "y", "width", "height", "lane")
"""Columns of integers in Parquet; the others are floats."""

_FORMULA = re.compile(r"[=+@\t\r-](?!\d*\.?\d*(e-?\d+)?$)")
"""Start of a text that a spreadsheet would run as a formula; numbers are excluded."""


def is_json(path: Path) -> bool:
    """Return whether a file is JSON by its name, and not a table."""
    return path.suffix.lower() == ".json"


def _plain_text(cell: Any) -> Any:
    return f"'{cell}" if isinstance(cell, str) and _FORMULA.match(cell) else cell


def plain_time(value: Any) -> Any:
    """Return a clock time as text, with milliseconds and its zone; other values unchanged."""
    return value.isoformat(" ", "milliseconds") if isinstance(value, datetime) else value


def read_table(path: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    """Return the rows of a `.csv` that `write_content` wrote.

    Raises `TruthError` if it cannot be read, or lacks one of the columns.
    """
    from vdet.labels.label import numbered_lines, read_bytes  # most runs only write tables

    lines = [line for _, line in numbered_lines(path, read_bytes(path))]
    try:
        reader = csv.DictReader(lines, restval="")
        rows = [{name: cell for name, cell in row.items() if name} for row in reader]
    except csv.Error as error:
        raise TruthError(f"{path}: cannot be read as a table: {error}") from error
    if not set(columns) <= set(reader.fieldnames or ()):
        raise TruthError(f"{path}: must have the columns {', '.join(columns)}")
    return [{name: _without_apostrophe(cell) for name, cell in row.items()} for row in rows]


def _without_apostrophe(cell: str) -> str:
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell[1:]) else cell


def check_table(path: Path) -> None:
    """Raise `PackageError` if a table needs a package that is not installed."""
    if path.suffix.lower() == ".parquet":
        with needing("parquet"):
            import pyarrow.parquet  # noqa: F401


def _write_parquet(path: Path, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Write a table; the type of a column depends only on its name."""
    import pyarrow as pa
    from pyarrow import parquet

    arrays = {}
    for number, name in enumerate(columns):
        column = [row[number] for row in rows]
        if name in _TEXTS:
            column = [text and valid_text(text) for text in column]
        kind = pa.string() if name in _TEXTS else pa.int64() if name in _INTEGERS else pa.float64()
        arrays[name] = pa.array(column, kind)
    parquet.write_table(pa.table(arrays), path)


def write_content(path: Path, content: Any) -> None:
    """Write JSON or a table (a list: heading, rows), by the suffix of `path`.

    In `.csv`, a text that a spreadsheet would run as a formula is prefixed with an apostrophe.
    """
    match path.suffix.lower():
        case ".json":
            write_text(path, json_text(content, ensure_ascii=False))
        case ".parquet":
            _write_parquet(path, content[0], content[1:])
        case _:  # the name of a video may be invalid text
            with path.open("w", encoding="utf-8", errors="backslashreplace", newline="") as file:
                rows = (map(_plain_text, row) for row in content)
                csv.writer(file, lineterminator="\n").writerows(rows)
