"""Workbooks, `.xlsx`: sheets of tables, ready to print."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import cache
from io import BytesIO
from itertools import compress
from pathlib import Path
from textwrap import wrap
from typing import Any

from vdet.boxes import Image
from vdet.files import valid_text
from vdet.media.images import encode_image

Cell = str | float | datetime | timedelta | None
"""A clock time shows its offset from UTC where that changes in a table. None is an empty cell."""

_LAST_ROW = 1_048_575
_LINE = 15
"""Height of a line of text, points. LibreOffice does not fit rows to wrapped text."""
_A4 = 9
_PICTURE_WIDTH = 768
"""Width of a picture in a sheet: 20 cm, in pixels at 96 dpi."""
_NARROWEST, _WIDEST = 7, 80
"""Widths of columns and of lines of text, characters."""
_NUMBER, _DURATION, _CLOCK = "0.0##", "[h]:mm:ss", "yyyy-mm-dd hh:mm:ss"
_TITLE = {"bold": True, "font_size": 14}
_HEADING = {"bold": True, "text_wrap": True, "valign": "top", "bottom": 1, "bg_color": "#E6F4F1"}


@dataclass(frozen=True, slots=True)
class SheetTable:
    """A table in a sheet; without headings if it has none."""

    headings: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    title: str = ""

    @property
    def clock_offset(self) -> str:
        """The format of the offset of clock times, if it changes in the table; else empty."""
        times = (cell for row in self.rows for cell in row if isinstance(cell, datetime))
        return " %z" if len({time.utcoffset() for time in times}) > 1 else ""

    def without_empty_columns(self) -> "SheetTable":
        """Return the table without the columns in which no row has a value."""
        filled = [
            any(cell is not None for cell in column) for column in zip(*self.rows, strict=True)
        ]
        rows = [list(compress(row, filled)) for row in self.rows]
        return replace(self, headings=list(compress(self.headings, filled)), rows=rows)


@dataclass(frozen=True, slots=True)
class Sheet:
    """Tables below one another, and below these a picture, BGR uint8 `(H, W, 3)`.

    A single table has a filter, and headings that are frozen and printed on each page. A sheet that
    is not `printed` has an empty print area.
    """

    name: str
    tables: Sequence[SheetTable]
    picture: Image | None = None
    printed: bool = True


def write_workbook(path: Path, sheets: Iterable[Sheet]) -> None:
    """Write sheets, row by row. Text is never run as a formula. Raises `OSError`."""
    from xlsxwriter import Workbook
    from xlsxwriter.exceptions import FileCreateError

    try:
        with Workbook(path, {"constant_memory": True}) as book:
            style = cache(lambda **values: book.add_format(values))
            for sheet in sheets:
                _SheetWriter(book.add_worksheet(sheet.name), style).write(sheet)
    except FileCreateError as error:
        raise OSError(str(error)) from error


class _SheetWriter:
    """Writes a sheet; `style` makes the format of a cell."""

    def __init__(self, page: Any, style: Callable[..., Any]) -> None:
        self._page, self._style = page, style
        self._row = 0
        self._widths: Counter[int] = Counter()

    def write(self, sheet: Sheet) -> None:
        width = max(len(row) for table in sheet.tables for row in (table.headings, *table.rows))
        for table in sheet.tables:
            self._table(table)
            self._row += 1
        for column, characters in self._widths.items():
            self._page.set_column(column, column, min(max(characters, _NARROWEST), _WIDEST) + 2)
        self._page.set_landscape()
        self._page.set_paper(_A4)
        self._page.fit_to_pages(1, 0 if sheet.picture is None else 1)
        self._page.set_footer("&L&F, &A&RPage &P of &N")
        if len(sheet.tables) == 1:
            top = bool(sheet.tables[0].title)
            self._page.freeze_panes(top + 1, 0)
            self._page.autofilter(top, 0, max(top + 1, self._row - 2), width - 1)
            if sheet.printed:
                self._page.repeat_rows(0, top)
            else:
                self._page.print_area(0, width, 0, width)
        if sheet.picture is not None:
            file = BytesIO(encode_image(sheet.picture, Path("scene.jpg")))
            scale = _PICTURE_WIDTH / sheet.picture.shape[1]
            options = {"image_data": file, "x_scale": scale, "y_scale": scale}
            self._page.insert_image(self._row, 0, "scene.jpg", options)

    def _table(self, table: SheetTable) -> None:
        if table.title:
            self._page.write_string(self._row, 0, valid_text(table.title), self._style(**_TITLE))
            self._row += 1
        if table.headings:
            self._headings(table)
        offset = table.clock_offset
        for row in table.rows if table.headings else _lines(table.rows):
            if self._row == _LAST_ROW:
                self._cell(0, "more rows do not fit into a sheet; .csv has all")
                break
            for column, cell in enumerate(row):
                width = self._cell(column, cell, offset)
                if table.headings or not (column and isinstance(cell, str)):
                    self._widen(column, width)
            self._row += 1

    def _headings(self, table: SheetTable) -> None:
        """Write the headings, numbers at the right, in a row that is high enough for all."""
        lines = 1
        for column, heading in enumerate(table.headings):
            is_number = any(isinstance(row[column], int | float) for row in table.rows[:9])
            style = self._style(**_HEADING, **({"align": "right"} if is_number else _left(column)))
            self._page.write_string(self._row, column, valid_text(heading), style)
            longest = max(map(len, heading.split()), default=0)
            self._widen(column, longest)
            lines = max(lines, len(wrap(heading, max(longest, _NARROWEST) + 2)))
        self._page.set_row(self._row, _LINE * lines)
        self._row += 1

    def _cell(self, column: int, cell: Cell, offset: str = "") -> int:
        """Write a cell, and return how wide its text is, characters; 0 for numbers."""
        at, left = (self._row, column), _left(column)
        match cell:
            case str():
                lines = len(wrap(cell, _WIDEST))
                style = self._style(text_wrap=lines > 1, **left)
                self._page.write_string(*at, valid_text(cell), style)
                if lines > 1:
                    self._page.set_row(self._row, _LINE * lines)
                return len(cell)
            case datetime():
                form = f'{_CLOCK}"{cell:{offset}}"' if offset else _CLOCK
                time, style = cell.replace(tzinfo=None), self._style(num_format=form, **left)
                self._page.write_datetime(*at, time, style)
                return len(form)
            case timedelta():
                self._page.write_datetime(*at, cell, self._style(num_format=_DURATION, **left))
            case int():
                self._page.write_number(*at, cell)
            case float():
                self._page.write_number(*at, cell, self._style(num_format=_NUMBER))
        return 0

    def _widen(self, column: int, width: int) -> None:
        self._widths[column] = max(self._widths[column], width)


def _lines(facts: Iterable[Sequence[Cell]]) -> Iterator[list[Cell]]:
    """Yield the rows of facts with lines of their texts, which go over the columns at the right."""
    for name, cell in facts:
        lines: list[Cell] = [*wrap(cell, _WIDEST)] if isinstance(cell, str) else [cell]
        yield from ([None if n else name, line] for n, line in enumerate(lines))


def _left(column: int) -> dict[str, Any]:
    """Return the alignment of a text: away from the number at its left."""
    return {"align": "left", "indent": int(column > 0)}
