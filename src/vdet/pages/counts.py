"""The page of `vdet count`: all files of a camera, such as those of a day."""

from collections import Counter, defaultdict
from datetime import datetime, timedelta

from vdet.boxes import Image
from vdet.errors import clock_text
from vdet.pages.charts import Plot, interval_plot, time_axis
from vdet.pages.render import Table, render
from vdet.pages.traffic import flow_table
from vdet.traffic.clock import Intervals
from vdet.traffic.counts import Counts, joined_counts
from vdet.traffic.survey import Survey
from vdet.traffic.workbook import Cell, SheetTable

_INTERVAL = 900
"""Seconds of an interval of the chart, unless the settings have one."""


def counts_page(survey: Survey, picture: Image | None = None) -> str:
    """Return the page; `picture` is the scene with lines and counts. Errors as for `Survey`."""
    facts = survey.facts()
    return render(
        "counts.html",
        title=facts.title,
        facts=_texts(facts)[1],
        volumes=_texts(survey.volumes()),
        flows=flow_table(joined_counts(survey.counts)),
        files=_texts(survey.files()),
        notes=_texts(survey.notes())[1],
        plot=_plot(survey.counts, survey.settings.traffic.seconds or _INTERVAL),
        picture=picture,
    )


def _texts(table: SheetTable) -> Table:
    """Return a table as text, without the classes that no vehicle has."""
    rows = [list(map(_text, row)) for row in table.rows]
    shown = [n for n, cells in enumerate(zip(*rows, strict=True)) if n < 3 or {*cells} - {"", "0"}]
    headings = [table.headings[n] for n in shown] if table.headings else []
    return headings, [[row[n] for n in shown] for row in rows]


def _text(cell: Cell) -> str:
    match cell:
        case None:
            return ""
        case datetime():
            return f"{cell:%Y-%m-%d %H:%M}"
        case timedelta():
            return clock_text(int(cell.total_seconds()), hours=True)
        case float():
            return f"{round(cell, 2):g}"
    return str(cell)


def _plot(counts: list[Counts], length: int) -> Plot | None:
    """Return the vehicles in each direction by interval; None if some of several have no clock."""
    if len(counts) > 1 and not all(video.clock for video in counts):
        return None
    intervals = Intervals([(video.clock, video.spans) for video in counts], length)
    first, last = intervals.periods[0], intervals.periods[-1]
    series: defaultdict[str, Counter[float]] = defaultdict(Counter)
    for index, video in enumerate(counts):
        for event in video.events:
            start = intervals.number(index, event.time) - first.number
            series[f"{event.name}: {event.direction}"][start] += 1
    zero = None
    if isinstance(first.start, datetime):
        zero = 3600.0 * first.start.hour + 60 * first.start.minute + first.start.second
    x = time_axis(0, last.number + length - first.number, zero)
    return interval_plot(series, x, length, "Vehicles by interval", zero) if series else None
