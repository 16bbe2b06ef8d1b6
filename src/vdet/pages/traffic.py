"""Lines, zones, counts, flows and paths over a frame; the pages of `vdet count` and `vdet draw`.

The first is about all files of a camera, such as those of a day; on the other, lines are drawn.
"""

import base64
import math
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import yaml
from markupsafe import Markup

from vdet import draw
from vdet.boxes import Image
from vdet.config.classes import UNKNOWN, is_chosen
from vdet.config.loading import in_pixels
from vdet.config.scene import APPROACHES, TrafficSettings
from vdet.config.schema import Settings
from vdet.draw import Color, Surface
from vdet.errors import ConfigError, clock_text
from vdet.findings import Finding
from vdet.media.images import encode_image, read_image
from vdet.pages.render import TEMPLATES, Plot, Table, interval_plot, jpeg_uri, render, time_axis
from vdet.polygons import Point
from vdet.track.track import FrameTracks
from vdet.traffic.counts import Counts, Direction, EventGroups
from vdet.traffic.crossings import Border, Line, VehiclePath, lines_and_zones, link_tracks
from vdet.traffic.output import Cell, SheetTable
from vdet.traffic.records import VehicleRecord
from vdet.traffic.survey import Survey

_INTERVAL = 900
"""Seconds of an interval of the chart, unless the settings have one."""

_WIDEST = 0.012
"""Width of the arrow of the largest flow, as a fraction of the frame's width."""
_SIDE = 0.04
"""Length of the arrows to the sides of a line, as a fraction of the frame's height."""
_SHORTEST = 0.03
"""Minimum length of a path to draw, as a fraction of the frame's width."""
_TIP = 0.012
"""Minimum length of the tip of an arrow, as a fraction of the frame's width."""
_SHADE = 0.18
"""Opacity of the colour over a zone."""
_SECTIONS = {"ground": "camera", "regions": "other", "lines": "traffic", "zones": "traffic"}
"""The lists that the page edits, and their section in the settings file."""


def counts_page(survey: Survey, picture: Image | None = None) -> str:
    """Return the page; `picture` is the scene with lines and counts. Errors as for `Survey`."""
    facts = survey.facts()
    return render(
        "counts.html",
        title=facts.title,
        facts=page_table(facts)[1],
        checks=page_table(survey.checks()),
        volumes=page_table(survey.volumes()),
        flows=page_table(survey.flows()),
        files=page_table(survey.files()),
        notes=page_table(survey.notes())[1],
        plot=_plot(survey, survey.settings.traffic.seconds or _INTERVAL),
        picture=picture,
    )


def _plot(survey: Survey, length: int) -> Plot | None:
    """Return the vehicles in each direction by interval; None if some of several have no clock.

    With lines, the events of zones are left out: most of their vehicles cross lines too.
    """
    if len(survey.counts) > 1 and not all(video.clock for video in survey.counts):
        return None
    directions = survey.groups.directions
    zones = {name for video in survey.counts for name in video.zones}
    names = {name for name, _ in directions} - zones or zones
    tally = survey.groups.tally(directions, length)
    periods = tally.intervals.periods
    first, last = periods[0], periods[-1]
    series = {": ".join(key): Counter[float]() for key in directions if key[0] in names}
    for key, period in product(directions, periods):
        if key[0] in names and (count := tally.numbers[period.number, key, None]):
            series[": ".join(key)][period.number] = count
    if not any(series.values()):
        return None
    to_clock = tally.intervals.to_clock
    x = time_axis(first.number, last.number + length, to_clock)
    return interval_plot(series, x, length, "Vehicles by interval", to_clock)


@dataclass(frozen=True, slots=True)
class DrawnMark:
    """A line through `points`, open, closed or an arrow; its label, if any, is at `at`, pixels."""

    points: Sequence[Point]
    color: Color
    width: int
    label: str = ""
    at: Point = (0, 0)
    is_closed: bool = False
    is_arrow: bool = False


def traffic_marks(
    size: tuple[int, int],
    borders: Sequence[Border],
    videos: Sequence[Counts],
    paths: Mapping[int, Sequence[Point]],
) -> list[DrawnMark]:
    """Return the marks to draw on frames of this width and height, pixels.

    `paths` are those of tracks by id, pixels. Without `videos` there are no numbers.
    """
    groups = EventGroups(videos)
    numbers = {direction: len(events) for direction, events in groups.directions.items()}
    totals = numbers if videos else None
    marks = [mark for border in borders for mark in border_marks(border, totals)]
    flows = groups.flows.values()
    maximum = max(map(len, flows), default=1)
    for number, trips in enumerate(flows):
        last_events = [trip.last or trip.event for trip in trips]
        shown = sorted((paths[event.id] for event in last_events if event.id in paths), key=len)
        typical = shown[len(shown) // 2] if shown else ()
        path = _inside(typical, size)
        if len(path) > 1:
            arrow = DrawnMark(
                path,
                color=draw.color_of(number),
                width=max(2, round(_WIDEST * size[0] * len(trips) / maximum)),
                label=str(len(trips)),
                at=path[len(path) // 2],
                is_arrow=True,
            )
            marks.insert(0, arrow)
    return marks


def path_marks(records: Iterable[VehicleRecord], size: tuple[int, int]) -> Iterator[DrawnMark]:
    """Yield the path of each vehicle that moved, in the colour of its direction."""
    width = max(1, size[1] // 720)
    for record in records:
        path = _inside(record.path, size)
        if record.length_fraction >= _SHORTEST and len(path) > 1:
            yield DrawnMark(path, direction_color(path[0], path[-1]), width, is_arrow=True)


def _inside(path: Sequence[Point], size: tuple[int, int]) -> list[Point]:
    """Return the points of a path inside the frame."""
    return [(x, y) for x, y in path if 0 <= x < size[0] and 0 <= y < size[1]]


def direction_color(start: Point, end: Point) -> Color:
    """Return the colour of the direction from one point to another."""
    angle = math.atan2(end[1] - start[1], end[0] - start[0])
    return draw.of_hue(angle / (2 * math.pi), 0.8)


def border_marks(
    border: Border, totals: Mapping[Direction, int] | None, text: str = ""
) -> Iterator[DrawnMark]:
    """Yield the marks of a zone with its name and a text, or of a line with its name and counts.

    The arrow to the left is at the start of a line, that to the right at its end: beside the
    traffic, and without labels over one another.
    """
    height = border.size[1]
    width = draw.line_width(np.empty((int(height), 0), np.uint8))
    if not isinstance(border, Line):
        top = min(border.corners, key=lambda corner: corner[1])
        yield DrawnMark(border.corners, draw.ZONE, width, border.name + text, top, is_closed=True)
        return
    (ax, ay), (bx, by) = border.start, border.end
    middle = (ax + bx) / 2, (ay + by) / 2
    yield DrawnMark((border.start, border.end), draw.LINE, width, border.name, middle)
    left = (by - ay) / border.length, (ax - bx) / border.length
    ends, reaches = (border.start, border.end), (_SIDE * height, -_SIDE * height)
    for (x, y), reach, direction in zip(ends, reaches, border.directions, strict=True):
        tip = x + reach * left[0], y + reach * left[1]
        number = "" if totals is None else f" {totals.get((border.name, direction), 0)}"
        yield DrawnMark(((x, y), tip), draw.LINE, width, direction + number, tip, is_arrow=True)


def draw_marks(surface: Surface, marks: Iterable[DrawnMark]) -> None:
    """Draw marks, their labels above all lines."""
    drawn = list(marks)
    for mark in drawn:
        if mark.is_closed:
            draw.shade(surface, mark.points, mark.color, _SHADE)
        draw.draw_lines(surface, mark.points, mark.color, mark.width, closed=mark.is_closed)
        if mark.is_arrow:
            end, length = mark.points[-1], max(3 * mark.width, _TIP * surface.shape[1])
            points = (point for point in reversed(mark.points) if math.dist(point, end) >= length)
            start = next(points, mark.points[0])
            tip = length / max(length, math.dist(start, end))
            draw.draw_arrow(surface, start, end, mark.color, mark.width, tip=tip)
    for mark in drawn:
        if mark.label:
            draw.draw_label(surface, mark.label, mark.at, mark.color)


def with_marks(image: Image, marks: Iterable[DrawnMark]) -> Image:
    """Return a copy of an image with marks on it."""
    drawn = image.copy()
    draw_marks(drawn, marks)
    return drawn


def survey_image(settings: Settings) -> Image | None:
    """Return the image `survey.picture`, if there is one.

    Raises
    ------
    ImageError
        It cannot be read.
    ConfigError
        The lines and zones are for frames of another aspect ratio.
    """
    if not settings.survey.picture:
        return None
    image = read_image(Path(settings.survey.picture))
    try:
        settings.traffic.for_frames(image.shape[1], image.shape[0])
    except ConfigError as error:
        raise ConfigError(f"{settings.survey.picture}: {error}") from error
    return image


def scene_picture(
    image: Image,
    settings: TrafficSettings,
    videos: Sequence[Counts],
    paths: Mapping[int, Sequence[Point]] = MappingProxyType({}),
) -> Image:
    """Return a frame with lines, zones, counts, and flows where their `paths` are known."""
    height, width = image.shape[:2]
    lines, zones = lines_and_zones(settings, width, height)
    return with_marks(image, traffic_marks((width, height), (*lines, *zones), videos, paths))


def page_table(table: SheetTable) -> Table:
    """Return a table as text, without the classes that no vehicle has."""
    offset = table.clock_offset
    rows = [[_cell_text(cell, offset) for cell in row] for row in table.rows]
    shown = [n for n, cells in enumerate(zip(*rows, strict=True)) if n < 3 or {*cells} - {"", "0"}]
    headings = [table.headings[n] for n in shown] if table.headings else []
    return headings, [[row[n] for n in shown] for row in rows]


def _cell_text(cell: Cell, offset: str) -> str:
    match cell:
        case None:
            return ""
        case datetime():
            return f"{cell:%Y-%m-%d %H:%M:%S{offset}}"
        case timedelta():
            return clock_text(round(cell.total_seconds()), hours=True)
        case float():
            return f"{round(cell, 2):g}"
    return str(cell)


class Drawing:
    """A frame of a camera with the paths of its vehicles.

    Parameters
    ----------
    image
        The frame, BGR uint8 `(H, W, 3)`.
    frames
        The tracks of its vehicles.
    values
        Values of the settings files so far, as of `given_values`.
    findings
        Reasons to doubt the tracks.

    Attributes
    ----------
    paths
        Paths of the vehicles that count, of the classes in the settings.
    """

    def __init__(
        self,
        image: Image,
        frames: Sequence[FrameTracks],
        settings: Settings,
        values: Mapping[str, Any],
        findings: Sequence[Finding] = (),
    ) -> None:
        height, width = image.shape[:2]
        self._image, self._frames, self._size = image, frames, (width, height)
        self._settings, self._values, self._findings = settings, values, findings
        minimum, linked = settings.traffic.min_seen_seconds, link_tracks(frames, width, height)
        self.paths: list[VehiclePath] = [
            path
            for path in linked
            if path.seconds >= minimum and is_chosen(path.class_name, settings.classes)
        ]

    def output(self, path: Path, name: str) -> bytes:
        """Return the content of a file by the suffix of `path`: a page or an image.

        `.svg` has counts and flows. Other images have none, so that a survey can add its own.
        `name` is the name of the settings file that the page saves. Raises `ConfigError`.
        """
        if path.suffix.lower() == ".html":
            return self._page(name).encode("utf-8", "backslashreplace")
        if path.suffix.lower() != ".svg":
            return encode_image(with_marks(self._image, self._marks(counts=[])), path)
        from vdet.traffic.counting import count_frames  # pages of runs load nothing of it

        marks = self._marks([count_frames(self._frames, self._settings, self._size)])
        width, height = self._size
        svg = render("traffic.svg", picture=self._image, width=width, height=height, marks=marks)
        return svg.encode("utf-8", "backslashreplace")

    def _page(self, name: str) -> str:
        shapes, other_settings = split(self._values, self._size)
        lens = self._settings.camera.lens
        times = [frame.time for frame in self._frames]
        data = {
            "name": name,
            "size": self._size,
            "focal": lens and lens.matrix_for(*self._size)[0][0],
            "span": (times[0], times[-1]) if times else (0, 0),
            "picture": jpeg_uri(self._image),
            "paths": pack_paths(self.paths),
            "places": shapes,
            "approaches": APPROACHES,
            "rest": other_settings,
        }
        scripts = ((TEMPLATES / script).read_text("utf-8") for script in ("yaml.js", "draw.js"))
        script = Markup("\n".join(scripts))
        return render("draw.html", data=data, name=name, script=script, findings=self._findings)

    def _marks(self, counts: Sequence[Counts]) -> list[DrawnMark]:
        lines, zones = lines_and_zones(self._settings.traffic, *self._size)
        paths = {
            key: path.points.tolist() for path in self.paths for key in np.unique(path.ids).tolist()
        }
        return traffic_marks(self._size, (*lines, *zones), counts, paths)


def split(
    values: Mapping[str, Any], size: tuple[int, int]
) -> tuple[dict[str, list[Any]], dict[str, list[str]]]:
    """Return the shapes in settings, in pixels, and the other settings as lines of YAML."""
    whole = in_pixels(values, *size)
    sections = {"camera": whole.pop("camera"), "traffic": whole.pop("traffic", None) or {}}
    sections["other"] = whole
    shapes = {kind: sections[name].pop(kind, None) or [] for kind, name in _SECTIONS.items()}
    del sections["camera"]["size"]
    other_settings = {
        name: [line if name == "other" else f"  {line}" for line in _yaml_lines(section)]
        for name, section in sections.items()
    }
    return shapes, other_settings


def _yaml_lines(values: Mapping[str, Any]) -> list[str]:
    text = yaml.dump(dict(values), Dumper=_Dumper, sort_keys=False, allow_unicode=True)
    return text.splitlines() if values else []


class _Dumper(yaml.SafeDumper):
    """Writes lists on one line, except lists of sections."""

    def represent_sequence(self, tag: str, sequence: Any, flow_style: Any = None) -> Any:
        is_flat = not any(isinstance(item, dict) for item in sequence)
        return super().represent_sequence(tag, sequence, is_flat or flow_style)


def pack_paths(paths: Sequence[VehiclePath]) -> dict[str, Any]:
    """Return paths as values for JSON: four rows of int32, each number minus the one before it.

    They are deflated. Times are µs since the first row, ground points are hundredths of a pixel.
    """
    changes = [np.empty((4, 0))]
    for path in paths:
        times = 1e6 * (path.times - path.times[0])
        rows = np.rint(np.vstack([times, 100 * path.points.T, path.heights]))
        changes.append(np.diff(rows, prepend=0))
    numbers = np.hstack(changes).astype("<i4")
    vehicles = [
        (
            path.vehicle,
            path.class_name or UNKNOWN,
            path.size,
            path.times[0],
            path.seen,
            len(path.times),
        )
        for path in paths
    ]
    data = base64.b64encode(zlib.compress(numbers.tobytes())).decode("ascii")
    return {"vehicles": vehicles, "data": data}
