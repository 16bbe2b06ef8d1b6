"""Files of counts, flows and vehicles: tables and JSON, of one video or several, and workbooks.

The ending of a name selects the table; `.json` has all tables. Several videos have one table by
interval; in tables of events and vehicles, the video is the first column. Workbooks, `.xlsx`, have
sheets of tables, ready to print.
"""

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, fields, replace
from datetime import datetime, timedelta
from functools import cache
from io import BytesIO
from itertools import compress, product
from pathlib import Path
from textwrap import wrap
from typing import Any

from vdet.boxes import Image
from vdet.config.scene import NOWHERE
from vdet.errors import TruthError, needing
from vdet.files import json_text, valid_text, write_text
from vdet.media.images import encode_image
from vdet.traffic import counts as tables
from vdet.traffic.counts import (
    Corrected,
    CountRow,
    Counts,
    DirectionTotal,
    Estimate,
    Event,
    EventGroups,
    FlowRow,
    Key,
    Tally,
    ZoneRow,
    seconds_checked,
)

SUFFIXES = (".csv", ".json", ".parquet")

VIDEO = "video"
"""The column with the name of the video."""
_TEXTS = (VIDEO, "class", "clock", "motion")
"""Columns of text in Parquet."""
_INTEGERS = ("id", "detected", "interpolated", "predicted", "x", "y", "width", "height", "lane")
"""Columns of integers in Parquet; the others are floats."""

_FORMULA = re.compile(r"[=+@\t\r-](?!\d*\.?\d*(e-?\d+)?$)")
"""Start of a text that a spreadsheet would run as a formula; numbers are excluded."""

_HEADINGS = {
    "class_name": "class", "origin": "from", "destination": "to", "is_part": "part"
}  # fmt: skip

ALL = "all"
"""In wide tables, the name of a sum."""

COUNT_SUFFIXES = (".csv", ".json", ".totals.csv", ".zones.csv", ".wide.csv", ".xlsx")
FLOW_SUFFIXES = (".csv", ".json", ".wide.csv", ".xlsx")

Videos = Mapping[str, Counts]
"""The counts of videos by their names."""

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


def _columns(row: type[Any]) -> tuple[str, ...]:
    return tuple(_HEADINGS.get(field.name, field.name) for field in fields(row))


_TOTALS, _ZONES, _FLOWS = map(_columns, (CountRow, ZoneRow, FlowRow))


_EVENTS = ("time", "clock", *_columns(Event)[1:])


def is_workbook(path: Path) -> bool:
    """Return whether a file is a workbook by its name."""
    return path.suffix.lower() == ".xlsx"


def counts_content(path: Path, videos: Videos, interval: int | None = None) -> Any:
    """Return the events, or by the ending of `path` the totals (also wide), zones, or all as JSON.

    Pass the result to `write_content`.

    Parameters
    ----------
    interval
        Interval of totals and zones, seconds; None for the whole video.

    Raises
    ------
    ConfigError
        As `count_table`.
    """
    every = list(videos.values())
    if is_json(path):
        (columns, *totals), zones = _totals(every, interval), tables.zone_table(every, interval)
        rows = [dict(zip(columns, row, strict=True)) for row in totals]
        content = {"totals": rows, "zones": _items(_ZONES, zones)}
        if any(video.corrected for video in every):
            content["volumes"] = list(map(_volume, tables.direction_totals(every)))
        return _json(videos, interval, content, events=True)
    if _is_table(path, ".totals"):
        return _totals(every, interval)
    if _is_table(path, ".wide"):
        groups = EventGroups(every)
        tally = groups.tally(groups.directions, interval)
        return wide_table(tally, groups.directions, groups.classes, ": ", has_total=False)
    if _is_table(path, ".zones"):
        return [_ZONES, *map(_cells, tables.zone_table(every, interval))]
    events = {name: [_event(video, e) for e in video.events] for name, video in videos.items()}
    if len(videos) == 1:
        return [_EVENTS, *(row for rows in events.values() for row in rows)]
    return [(VIDEO, *_EVENTS), *([name, *row] for name, rows in events.items() for row in rows)]


def _totals(every: Sequence[Counts], interval: int | None) -> list[Sequence[Any]]:
    """Return the heading and the rows of totals, after corrections also what was counted before.

    `checked` is how many seconds of the interval were checked at the line or zone.
    """
    if not any(video.corrected for video in every):
        return [_TOTALS, *map(_cells, tables.count_table(every, interval))]
    groups, others = EventGroups(every), EventGroups([video.uncorrected for video in every])
    tally = groups.tally(groups.directions, interval)
    before = others.tally(others.directions, interval)
    checked = [
        seconds_checked(every, tally.intervals, period, name)
        for period, (name, _) in product(tally.intervals.periods, groups.directions)
        for _ in {*tally.classes, *before.classes} or [None]
    ]
    after = tally.rows(groups.directions, before.classes)
    counted = (row[-4] for row in before.rows(groups.directions, tally.classes))
    rows = [
        [*_cells(CountRow(*row)), *more] for row, *more in zip(after, counted, checked, strict=True)
    ]
    return [(*_TOTALS, "counted", "checked"), *rows]


def flows_content(path: Path, videos: Videos, interval: int | None = None) -> Any:
    """Return the flows, or by the ending of `path` a wide table, or all as JSON.

    Parameters and errors as for `counts_content`.
    """
    every = list(videos.values())
    if is_json(path):
        rows = _items(_FLOWS, tables.flow_table(every, interval))
        content = {"flows": rows, "matrix": flow_matrix(every)}
        return _json(videos, interval, content, events=False)
    if _is_table(path, ".wide"):
        groups = EventGroups(every)
        tally = groups.tally(groups.flows, interval)
        return wide_table(tally, groups.ordered_flows, groups.classes, " to ", has_total=True)
    return [_FLOWS, *map(_cells, tables.flow_table(every, interval))]


def wide_table(
    tally: Tally[Key], keys: Iterable[Key], classes: Sequence[str], between: str, *, has_total: bool
) -> list[Sequence[Any]]:
    """Return a table with a row for each interval, a column for each key and class, and sums.

    `between` is the text between the two names of a key. With `has_total`, the last column is the
    sum of all keys.
    """
    columns = [(key, name) for key in keys for name in (*classes, None)]
    heading = [f"{between.join(tables.names_in(key))}, {name or ALL}" for key, name in columns]
    every: list[tuple[Key | None, str | None]] = [*columns, *([(None, None)] if has_total else [])]
    times = [(period.start, period.end, period.number) for period in tally.intervals.periods]
    body = (
        [plain_time(start), plain_time(end), *(tally.numbers[number, *column] for column in every)]
        for start, end, number in (*times, (ALL, "", None))
    )
    return [("start", "end", *heading, *([ALL] if has_total else [])), *body]


def flow_matrix(videos: Sequence[Counts]) -> dict[str, dict[str, int]]:
    """Return the number of vehicles by origin and destination, which may be `NOWHERE`."""
    groups = EventGroups(videos)
    names = groups.flow_names
    return {
        origin: {end or NOWHERE: len(groups.flows.get((origin, end), ())) for end in (*names, None)}
        for origin in names
    }


def _json(
    videos: Videos, interval: int | None, tables: Mapping[str, Any], *, events: bool
) -> dict[str, Any]:
    by_video: dict[str, Any] = {}
    for name, video in videos.items():
        begin = plain_time(video.clock and video.clock.at(video.spans[0][0]))
        notes = [str(item) for item in video.findings if item.severity == "note"]
        by_video[name] = {"begin": begin, "warnings": list(video.warnings), "notes": notes}
        if video.corrected:
            by_video[name]["corrected"] = _corrected(video.corrected)
        if video.traces:
            by_video[name]["traces"] = [asdict(trace) for trace in video.traces]
        if events:
            rows = (_event(video, event) for event in video.events)
            by_video[name]["events"] = [dict(zip(_EVENTS, row, strict=True)) for row in rows]
    facts = by_video.popitem()[1] if len(videos) == 1 else {"videos": by_video}
    return {"interval": interval, **tables, **facts}


def _corrected(corrected: Corrected) -> dict[str, Any]:
    corrections = [
        {name: plain_time(value) for name, value in item.record.items()}
        for item in corrected.corrections
    ]
    estimates = [
        {
            "name": item.group.name,
            "direction": item.group.direction,
            "class": item.group.class_name,
            **_columns_of(item.counted, item.corrected, item),
            "more": item.minutes_to_precision,
        }
        for item in corrected.estimates
    ]
    return {
        "events": len(corrections),
        "files": list(corrected.files),
        "names": list(corrected.names),
        "checked": [list(span) for span in corrected.checked],
        "corrections": corrections,
        "estimates": estimates,
    }


def _volume(total: DirectionTotal) -> dict[str, Any]:
    columns = _columns_of(total.counted, total.count, total.estimate)
    return {"name": total.name, "direction": total.direction, **columns}


def _columns_of(counted: int, corrected: int, estimate: Estimate | None) -> dict[str, Any]:
    """Return a total as counted, corrected and estimated, with its interval; None: unknown."""
    limits = (estimate.true, estimate.low, estimate.high) if estimate else (None,) * 3
    names = zip(("estimated", "low", "high"), limits, strict=True)
    values = {name: None if value is None else round(value, 1) for name, value in names}
    return {"counted": counted, "corrected": corrected, **values}


def _is_table(path: Path, kind: str) -> bool:
    return path.name.lower().endswith(f"{kind}.csv")


def _event(video: Counts, event: Event) -> list[Any]:
    time, *values = astuple(event)
    return [time, plain_time(video.clock and video.clock.at(time)), *values]


def _items(columns: Sequence[str], rows: Iterable[Any]) -> list[dict[str, Any]]:
    return [dict(zip(columns, map(plain_time, astuple(row)), strict=True)) for row in rows]


def _cells(row: Any) -> list[Any]:
    cells = list(map(plain_time, astuple(row)))
    return [NOWHERE if n == 3 and cell is None else cell for n, cell in enumerate(cells)]


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
