"""Tables and JSON files of one video and of many; in those of many, the video comes first."""

import csv
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

from vdet.errors import OutputError
from vdet.files import write_text

SUFFIXES = (".csv", ".json")

VIDEO = "video"
"""The column that has the name of the video."""


_FORMULA = re.compile(r"[=+@\t\r-](?!\d*\.?\d*(e-?\d+)?$)")
"""How a text begins that a spreadsheet takes for a formula; a number is none."""


def is_json(path: Path) -> bool:
    """Return whether a file is JSON by its name; else it is a table."""
    return path.suffix.lower() == ".json"


def write_table(path: Path, columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write a table with a heading.

    A text that a spreadsheet would take for a formula gets an apostrophe in front.
    """
    # The name of a video may be no valid text.
    with path.open("w", encoding="utf-8", errors="backslashreplace", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(map(_plain_text, columns))
        table.writerows(map(_plain_text, row) for row in rows)


def _plain_text(cell: Any) -> Any:
    return f"'{cell}" if isinstance(cell, str) and _FORMULA.match(cell) else cell


def plain_moment(value: Any) -> Any:
    """Return a moment as text, with its time zone; other values as they are."""
    if not isinstance(value, datetime):
        return value
    return value.isoformat(" ", "milliseconds" if value.microsecond else "seconds")


def write_json(path: Path, value: Any) -> None:
    """Write JSON, indented."""
    text = json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    write_text(path, text)


def join(
    outputs: Mapping[str, Path],
    path: Path,
    columns: tuple[str, ...] | None,
    joined: Callable[[Mapping[str, Any]], Any],
) -> None:
    """Join the files of many videos, given by the names of the videos, into one of the same form.

    `joined` makes the JSON of all videos from that of each. Tables have `columns`; None for those
    of the first one.

    Raises
    ------
    OutputError
        One of `outputs` has another content.
    """
    if not is_json(path):
        rows = _rows(outputs, columns)
        write_table(path, next(rows, [VIDEO]), rows)
        return
    values: dict[str, Any] = {}
    for name, each in outputs.items():
        with _checked(each):
            values[name] = json.loads(each.read_text("utf-8"))
            joined({name: values[name]})
    write_json(path, joined(values))


def _rows(outputs: Mapping[str, Path], columns: tuple[str, ...] | None) -> Iterator[Sequence[str]]:
    """Yield the heading, and the rows of all tables."""
    if columns:
        yield VIDEO, *columns
    for name, path in outputs.items():
        with _checked(path), path.open(encoding="utf-8", newline="") as file:
            rows = csv.reader(file, strict=True)
            heading = tuple(next(rows, ()))
            if columns is None:
                columns = heading
                yield VIDEO, *columns
            if heading != columns:
                raise ValueError("other columns")
            yield from ([name, *row] for row in rows)


@contextmanager
def _checked(path: Path) -> Iterator[None]:
    """Turn what is raised for an unexpected content into an `OutputError`."""
    try:
        yield
    except (ValueError, TypeError, LookupError, csv.Error) as error:
        message = f"{path}: has other content than expected; remove it, and run again"
        raise OutputError(message) from error
