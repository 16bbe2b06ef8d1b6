"""Charts as SVG that is part of the page.

Places along the time axis are percentages, and text has the size of the page's text, so a chart can
be read at any width.
"""

import heapq
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from vdet.draw.boxes import color_of, text_color

STYLE = """
.chart { display: block; width: 100%; overflow: hidden; margin: 6px 0 2px;
  font: 12px system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
.chart text { fill: var(--soft); } .chart .grid { stroke: var(--line); }
.chart .value { paint-order: stroke; stroke: var(--paper); stroke-width: 4px; }
@media (max-width: 800px) { .chart .roomy { display: none; } }
.chart .level { fill: var(--fill); shape-rendering: crispEdges; }
.chart a:hover, .chart a:focus-visible { opacity: .75; }
.legend { display: flex; flex-wrap: wrap; gap: 4px 16px; font-size: 13px; color: var(--soft); }
.legend i { display: inline-block; width: 11px; height: 11px; border-radius: 3px;
  margin-right: 6px; }
"""

_HEIGHT = 150  # of the plot, pixels
_AXIS = 22  # of the labels below it
_TOP = 16  # above the highest value, for its label
_OVERLAP = 0.2  # of a level with the next, percent; else there may be a gap as thin as a hair
_ROW = 24  # of a vehicle
_NARROWEST = 300  # of a chart on a phone, pixels
_ROOMY = 700  # of a chart in a window of more than 800 pixels
_TICKS = 5  # most labels along the time
_TIMES = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 21600, 43200)
_COLORS = ("#0f9d8a", "#d97706", "#6366f1", "#db2777", "#65a30d", "#0284c7", "#b45309", "#9333ea")


@dataclass(frozen=True, slots=True)
class Span:
    """A vehicle in the chart of spans: `first` and `last` in seconds; a click leads to `link`."""

    id: int
    first: float
    last: float
    what: str
    link: str


@dataclass(frozen=True, slots=True)
class Series:
    """How often something happened in each minute; minute n ends n + 1 minutes after second 0."""

    name: str
    by_minute: Mapping[int, int]


def clock(seconds: float) -> str:
    """Write a time as `m:ss` or `h:mm:ss`, with tenths where it is no whole second."""
    tenths = round(abs(seconds) * 10)
    whole, tenth = divmod(tenths, 10)
    hours, rest = divmod(whole, 3600)
    minutes, rest = divmod(rest, 60)
    text = f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
    sign = "−" if seconds < 0 and tenths else ""
    return sign + text + (f".{tenth}" if tenth else "")


def level_chart(levels: Sequence[int], start: float, end: float, what: str) -> str:
    """Return a chart of a number over time; `levels` are of equal steps from `start` to `end`."""
    top = _top(max(levels, default=0))
    width = 100 / max(1, len(levels))
    bars, first = [], 0
    for level, run in itertools.groupby(levels):
        steps = len(list(run))
        if level:
            bars.append(
                f'<rect class="level" x="{_percent(first * width)}" '
                f'width="{_percent(steps * width + _OVERLAP)}" {_height(0, level, top)}/>'
            )
        first += steps
    axis = _time_axis(start, end, _bottom())
    return _svg(what, _bottom() + _AXIS, "".join(bars) + _grid(top) + axis)


def minute_chart(series: Sequence[Series], minutes: range, what: str) -> str:
    """Return a chart with a bar for each minute, in which the series are stacked, and a legend."""
    sums = [sum(each.by_minute.get(n, 0) for each in series) for n in minutes]
    top = _top(max(sums, default=0))
    bars = "".join(_minute_bars(series, minutes, top))
    axis = _time_axis(60 * minutes.start, 60 * minutes.stop, _bottom())
    return _svg(what, _bottom() + _AXIS, bars + _grid(top) + axis) + _legend(series)


def span_chart(spans: Iterable[Span], start: float, end: float, what: str) -> str:
    """Return a chart with a bar for each vehicle, from its first to its last time.

    Vehicles that are not there at once share a row.
    """
    rows = list(_rows(sorted(spans, key=lambda span: (span.first, span.id))))
    bars = "".join(
        _span(span, row, start, max(end - start, 1e-9)) for row, inside in enumerate(rows)
        for span in inside
    )  # fmt: skip
    bottom = _ROW * len(rows) + 4
    return _svg(what, bottom + _AXIS, bars + _time_axis(start, end, bottom))


def _svg(what: str, height: float, content: str) -> str:
    return (
        f'<svg class="chart" role="img" aria-label="{escape(what)}" height="{height:g}">'
        f"{content}</svg>"
    )


def _percent(value: float) -> str:
    return f"{value:.3f}".rstrip("0").rstrip(".") + "%"


def _bottom() -> int:
    return _TOP + _HEIGHT


def _y(value: float, top: float) -> float:
    return _TOP + _HEIGHT * (1 - value / top)


def _height(low: float, high: float, top: float) -> str:
    """Return the place of a bar from one value to another; it can always be seen."""
    height = max(1.0, _y(low, top) - _y(high, top))
    return f'y="{_y(low, top) - height:.1f}" height="{height:.1f}"'


def _top(most: int) -> int:
    """Return the end of the vertical axis: a number with two to five even parts."""
    step = _grid_step(most)
    return step * max(1, -(-most // step))


def _grid_step(most: int) -> int:
    for power in range(12):
        for factor in (1, 2, 5):
            if most <= 4 * (step := factor * 10**power):
                return int(step)
    return most


def _grid(top: int) -> str:
    """Return lines across the plot, each with its value above its left end."""
    parts = []
    for value in range(0, top + 1, _grid_step(top)):
        y = _y(value, top)
        parts.append(f'<line class="grid" x1="0" x2="100%" y1="{y:.1f}" y2="{y:.1f}"/>')
        if value:
            parts.append(f'<text class="value" x="2" y="{y - 3:.1f}">{value}</text>')
    return "".join(parts)


def _time_axis(start: float, end: float, y: float) -> str:
    length = max(end - start, 1e-9)
    step = next((step for step in _TIMES if length / step <= _TICKS), length / _TICKS)
    parts = []
    for number in range(math.ceil(start / step), math.floor(end / step) + 1):
        share = 100 * (number * step - start) / length
        anchor = "start" if share < 4 else "end" if share > 96 else "middle"
        parts.append(
            f'<line class="grid" x1="{_percent(share)}" x2="{_percent(share)}" '
            f'y1="{y}" y2="{y + 5}"/><text x="{_percent(share)}" y="{y + 18}" '
            f'text-anchor="{anchor}">{clock(number * step)}</text>'
        )
    return "".join(parts)


def _minute_bars(series: Sequence[Series], minutes: range, top: float) -> Iterator[str]:
    width = 100 / max(1, len(minutes))
    for place, minute in enumerate(minutes):
        below = 0
        for number, each in enumerate(series):
            value = each.by_minute.get(minute, 0)
            if value:
                yield (
                    f'<rect x="{_percent(width * (place + 0.1))}" width="{_percent(width * 0.8)}" '
                    f'{_height(below, below + value, top)} fill="{_color(number)}">'
                    f"<title>{clock(60 * minute)}: {value} {escape(each.name)}</title></rect>"
                )
            below += value


def _color(number: int) -> str:
    return _COLORS[number % len(_COLORS)]


def _legend(series: Sequence[Series]) -> str:
    items = "".join(
        f'<span><i style="background:{_color(number)}"></i>{escape(each.name)}: '
        f"{sum(each.by_minute.values())}</span>"
        for number, each in enumerate(series)
    )
    return f'<div class="legend">{items}</div>'


def _rows(spans: Iterable[Span]) -> list[list[Span]]:
    """Put spans, in the order of their begin, into as few rows as possible."""
    rows: list[list[Span]] = []
    free: list[tuple[float, int]] = []  # when the last of a row ends, and the row
    for span in spans:
        if free and free[0][0] < span.first:
            _, row = heapq.heappop(free)
        else:
            row = len(rows)
            rows.append([])
        rows[row].append(span)
        heapq.heappush(free, (span.last, row))
    return rows


def _span(span: Span, row: int, start: float, length: float) -> str:
    """Return a bar with the colour that the vehicle's box has in the video."""
    blue, green, red = color = color_of(span.id)
    ink = "#{:02x}{:02x}{:02x}".format(*text_color(color)[::-1])
    x = 100 * (span.first - start) / length
    width = 100 * (span.last - span.first) / length
    return (
        f'<a {span.link}><svg x="{_percent(x)}" y="{row * _ROW + 2}" '
        f'width="{_percent(max(width, 0.3))}" height="{_ROW - 4}">'
        f"<title>{escape(span.what)}</title>"
        f'<rect width="100%" height="100%" rx="4" fill="rgb({red},{green},{blue})"/>'
        f"{_name(span.id, width, ink)}</svg></a>"
    )


def _name(number: int, width: float, ink: str) -> str:
    """Return the id for a bar of a width in percent; nothing where it would be cut off."""
    text = f"#{number}"
    needed = 100 * (10 + 7.5 * len(text))
    if width * _ROOMY < needed:
        return ""
    kind = "" if width * _NARROWEST >= needed else ' class="roomy"'
    return f'<text{kind} x="5" y="{_ROW / 2 + 2:g}" style="fill:{ink}">{text}</text>'
