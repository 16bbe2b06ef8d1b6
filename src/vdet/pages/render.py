"""Render pages: one HTML file that loads nothing from the network, in light and dark mode.

Charts are drawn as SVG. Positions along both axes are percentages, and text has the size of the
page's text, so that charts are readable at any width.
"""

import base64
import heapq
import itertools
import math
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import quote

import cv2
from markupsafe import Markup, escape

from vdet.boxes import Image
from vdet.draw import Color
from vdet.errors import clock_text, escaped, quantity
from vdet.media.images import shrunk
from vdet.version import __version__

Table = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Headings and rows of text."""
PAGE_NAME, REVIEW_NAME = "page.html", "review.html"
"""File name of a page in its folder."""
TEMPLATES = Path(__file__).parent / "templates"
_QUALITY = 84  # of JPEG pictures
_SMALL_SIDE, _SMALL_BYTES = 96, 2048
_COLORS = ("#0f9d8a", "#d97706", "#6366f1", "#db2777", "#65a30d", "#0284c7", "#b45309", "#9333ea")
_TICKS = 5  # maximum number of intervals on an axis
_TIMES = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 21600, 43200)
_NOTHING = 1e-9  # length of an axis whose ends are equal
_CHANGE = 1800  # seconds; clocks are changed by a multiple
_DAY, _ROUND = 86_400, datetime(1970, 1, 1)

ToClock = Callable[[float], datetime] | None
"""Converts seconds to clock times; None: they are those in the video."""


def render(template: str, **values: Any) -> str:
    """Render a file in `templates` with values, all of them escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"quantity": quantity, "jpeg": jpeg_uri, "hex": hex_color}
    environment.filters |= {"clock": time_text, "line": lambda text: escaped(str(text))}
    environment.filters |= {"name": _breakable}
    return environment.get_template(template).render(values, version=__version__)


def _breakable(name: str) -> Markup:
    """Return a name that is broken at its separators rather than in its numbers."""
    return Markup(re.sub(r"(?<=[-_/.])", "<wbr>", escape(name)))


def jpeg_uri(image: Image, max_side: int | None = None) -> str:
    """Return a BGR uint8 image as a data URI; its longer side has at most `max_side` pixels."""
    if max_side:
        image = shrunk(image, max_side / max(image.shape[:2]))
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode("ascii")


def thumbnail(image: Image) -> bytes:
    """Return a BGR uint8 image as WebP of at most 96 pixels and 2 KB."""
    small = shrunk(image, _SMALL_SIDE / max(image.shape[:2]))
    for quality in (70, 50, 30, 10):
        data = cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, quality])[1].tobytes()
        if len(data) <= _SMALL_BYTES:
            break
    return data


def webp_uri(data: bytes) -> str:
    """Return a WebP image as a data URI."""
    return "data:image/webp;base64," + base64.b64encode(data).decode("ascii")


def link_to(path: Path, folder: Path) -> str:
    """Return the relative address of a file for a page in `folder`."""
    return quote(os.fsencode(os.path.relpath(path, folder)))


@dataclass(frozen=True, slots=True)
class Axis:
    """The ends of an axis, and its labels as `(value, text)`."""

    low: float
    high: float
    ticks: Sequence[tuple[float, str]]

    def at(self, value: float) -> float:
        """Return the position of a value on the axis, percent, limited to its ends."""
        return min(max(0.0, self.width(self.low, value)), 100.0)

    def width(self, first: float, last: float) -> float:
        """Return the distance between two values, percent of the axis."""
        return round(100 * (last - first) / max(self.high - self.low, _NOTHING), 3)


@dataclass(frozen=True, slots=True)
class Bar:
    """A bar from `left` to `right` and from `low` to `high`, in the units of the axes.

    In a timeline, `low` is its row, and it may have a `label` in the colour `ink`; a click jumps to
    its left end in the video.
    """

    left: float
    right: float
    low: float
    high: float
    color: str
    title: str
    label: str = ""
    ink: str = ""


@dataclass(frozen=True, slots=True)
class Plot:
    """Bars on two axes."""

    title: str
    x: Axis
    y: Axis
    bars: Sequence[Bar]
    legend: Sequence[tuple[str, str]]


def hex_color(bgr: Color) -> str:
    """Return a colour in CSS notation."""
    return "#{:02x}{:02x}{:02x}".format(*bgr[::-1])


def time_text(seconds: float, to_clock: ToClock = None) -> str:
    """Write a time as `m:ss` or `h:mm:ss`, with tenths if it is not a whole second.

    With `to_clock`, it is the time of day.
    """
    if to_clock is None:
        return clock_text(seconds, 1).removesuffix(".0")
    return f"{to_clock(seconds) + timedelta(seconds=0.5):%H:%M:%S}".removesuffix(":00")


def time_axis(start: float, end: float, to_clock: ToClock = None) -> Axis:
    """Return an axis of times in seconds; `to_clock` as for `time_text`."""
    length = max(end - start, _NOTHING)
    days = _DAY * math.ceil(length / _TICKS / _DAY)
    step = next((step for step in _TIMES if length / step <= _TICKS), days)

    def since(time: float) -> float:
        """Return the seconds from a round time, by the clock."""
        return (to_clock(time).replace(tzinfo=None) - _ROUND).total_seconds() if to_clock else time

    fine = min(step, _CHANGE)
    first = start + -since(start) % fine
    times = [first + number * fine for number in range(math.floor((end - first) / fine) + 1)]
    ticks = [time for time in times if round(since(time) % step, 3) in (0, step)]
    return Axis(start, end, [(time, time_text(time, to_clock)) for time in ticks])


def number_axis(high: int) -> Axis:
    """Return an axis of whole numbers from 0, with equal intervals and a round end."""
    steps = (item * 10**power for power in itertools.count() for item in (1, 2, 5))
    step = next(step for step in steps if high <= _TICKS * step)
    numbers = range(0, high + step, step)
    return Axis(0, numbers[-1], [(number, str(number)) for number in numbers])


def interval_plot(
    series: Mapping[str, Counter[float]],
    x: Axis,
    interval: int,
    title: str,
    to_clock: ToClock = None,
) -> Plot:
    """Return a plot with a bar for each interval with events, stacked by series, and a legend.

    A series has the number of events in each interval, by its start in seconds. `interval` is in
    seconds, `to_clock` as for `time_text`.
    """
    bars, highest = list[Bar](), 1
    colors = dict(zip(series, itertools.cycle(_COLORS), strict=False))
    for at in sorted(set().union(*series.values())):
        left, right, below = at + 0.1 * interval, at + 0.9 * interval, 0
        for name, counts in series.items():
            if count := counts[at]:
                tip = f"{time_text(at, to_clock)}: {count} {name}"
                bars.append(Bar(left, right, below, below + count, colors[name], tip))
                below += count
        highest = max(highest, below)
    legend = [(f"{name}: {counts.total()}", colors[name]) for name, counts in series.items()]
    return Plot(title, x, number_axis(highest), bars, legend)


def pack_rows(spans: Iterable[tuple[float, float]]) -> list[int]:
    """Return a row for each span, given in order of start; simultaneous spans differ in row."""
    rows: list[int] = []
    free: list[tuple[float, int]] = []  # end of the last span in a row, and the row
    for first, last in spans:
        row = heapq.heappop(free)[1] if free and free[0][0] < first else len(free)
        rows.append(row)
        heapq.heappush(free, (last, row))
    return rows
