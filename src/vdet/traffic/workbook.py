"""Workbooks, `.xlsx`: sheets of tables, ready to print."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cache
from io import BytesIO
from itertools import zip_longest
from pathlib import Path
from typing import Any

Cell = str | float | datetime | timedelta | None
"""A clock time is written without its zone, and None as an empty cell."""

_LAST_ROW = 1_048_575
_A4 = 9
PICTURE_WIDTH = 1280
"""Width of a picture, pixels."""
_PICTURE_SCALE = 0.6
_CLOCK, _DURATION = "yyyy-mm-dd hh:mm:ss", "[h]:mm:ss"
_TITLE = {"bold": True, "font_size": 14}
_HEADING = {
    "bold": True, "text_wrap": True, "valign": "top", "bottom": 1, "bg_color": "#E6F4F1",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its width in characters, and the format of numbers as spreadsheets have it.

    Text goes on over the empty cells to its right unless it is wrapped.
    """

    heading: str = ""
    width: int = 10
    number_format: str = "General"
    is_wrapped: bool = False


@dataclass(frozen=True, slots=True)
class SheetTable:
    """A table in a sheet; without headings if all are empty."""

    columns: Sequence[Column]
    rows: Iterable[Sequence[Cell]]
    title: str = ""


@dataclass(frozen=True, slots=True)
class Sheet:
    """Tables below one another, and below these a picture: a JPEG file, not over `PICTURE_WIDTH`.

    A single table without a title has a filter, and headings that are frozen and printed on each
    page.
    """

    name: str
    tables: Sequence[SheetTable]
    picture: bytes | None = None


def write_workbook(path: Path, sheets: Iterable[Sheet]) -> None:
    """Write sheets, row by row. Text is never run as a formula. Raises `OSError`."""
    from xlsxwriter import Workbook
    from xlsxwriter.exceptions import FileCreateError

    try:
        with Workbook(path, {"constant_memory": True}) as book:
            style = cache(lambda **values: book.add_format(values))
            for sheet in sheets:
                _write_sheet(book.add_worksheet(sheet.name), sheet, style)
    except FileCreateError as error:
        raise OSError(str(error)) from error


def _write_sheet(page: Any, sheet: Sheet, style: Callable[..., Any]) -> None:
    page.set_landscape()
    page.set_paper(_A4)
    page.fit_to_pages(1, 1 if sheet.picture else 0)
    page.set_footer("&L&F, &A&RPage &P of &N")
    for number, columns in enumerate(zip_longest(*(table.columns for table in sheet.tables))):
        page.set_column(number, number, max(column.width for column in filter(None, columns)))
    row = 0
    for table in sheet.tables:
        row = _write_table(page, table, row, style)
    if len(sheet.tables) == 1 and not sheet.tables[0].title:
        page.freeze_panes(1, 0)
        page.repeat_rows(0)
        page.autofilter(0, 0, max(1, row - 2), len(sheet.tables[0].columns) - 1)
    if sheet.picture:
        scale = {"x_scale": _PICTURE_SCALE, "y_scale": _PICTURE_SCALE}
        page.insert_image(row, 0, "scene", {"image_data": BytesIO(sheet.picture), **scale})


def _write_table(page: Any, table: SheetTable, row: int, style: Callable[..., Any]) -> int:
    """Write a table from a row on; return the row for the next one."""
    if table.title:
        page.write_string(row, 0, _valid(table.title), style(**_TITLE))
        row += 1
    if any(column.heading for column in table.columns):
        for number, column in enumerate(table.columns):
            page.write_string(row, number, _valid(column.heading), style(**_HEADING))
        row += 1
    for cells in table.rows:
        if row == _LAST_ROW:
            page.write_string(row, 0, "more rows do not fit into a sheet; .csv has all")
            break
        for number, (cell, column) in enumerate(zip(cells, table.columns, strict=True)):
            _write_cell(page, (row, number), cell, column, style)
        row += 1
    return row + 1


def _write_cell(
    page: Any, at: tuple[int, int], cell: Cell, column: Column, style: Callable[..., Any]
) -> None:
    """Write a cell at a row and column."""
    match cell:
        case None:
            pass
        case str():
            page.write_string(*at, _valid(cell), style(text_wrap=column.is_wrapped, valign="top"))
        case datetime():
            time = cell.replace(tzinfo=None)
            page.write_datetime(*at, time, style(num_format=_CLOCK, align="left"))
        case timedelta():
            page.write_datetime(*at, cell, style(num_format=_DURATION, align="left"))
        case _:
            page.write_number(*at, cell, style(num_format=column.number_format))


def _valid(text: str) -> str:
    """Return text without the parts of a file name that are no text."""
    return text.encode(errors="backslashreplace").decode()
