"""The page of a video: when vehicles were there, where, what they looked like."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import cv2

from vdet.files import escaped
from vdet.media.images import Image
from vdet.pages import charts, player
from vdet.pages.charts import Series, Span, clock, level_chart, minute_chart, span_chart
from vdet.pages.facts import Facts, facts_html
from vdet.pages.frame import cards, jpeg_uri, page, paragraph, section
from vdet.pages.player import SCRIPT, Player, jump, player_html
from vdet.traffic.levels import Levels
from vdet.traffic.records import VehicleRecord

_STEPS = 160  # of the chart of levels
_TILE = 104  # of a vehicle's picture, pixels
_MOST_ROWS = 50  # of a table that is open from the beginning
_SMALL = 200  # columns of the still in the pages over many videos

_STYLE = """
.still { width: 100%; border-radius: 8px; display: block; }
.vehicles a { color: inherit; text-decoration: none; display: block; }
.vehicles img { aspect-ratio: 4 / 3; object-fit: contain; }
.vehicles a:hover img, .vehicles a:focus-visible img { outline: 3px solid var(--mark); }
summary { cursor: pointer; color: var(--mark); margin: 8px 0; }
pre { overflow-x: auto; font-size: 12.5px; line-height: 1.45; margin: 8px 0 0; }
.vehicles-table td:nth-child(2) { text-align: left; }
"""


@dataclass(frozen=True, slots=True)
class Thumbnail:
    """The picture of a vehicle as a data URI, and the time of its frame in seconds."""

    time: float
    uri: str


@dataclass(frozen=True, slots=True)
class VideoReport:
    """What the page of a video shows.

    Attributes
    ----------
    folder
        Where the page will lie.
    width, height
        Of the frames, pixels.
    start, end
        When the first frame is shown, and when the last one ends, seconds as in the tracks.
    thumbnails
        By id; a vehicle may have none.
    still
        A frame with the heat over it, BGR uint8; None if there was no frame.
    most_vehicles
        How many vehicles are shown one by one.
    settings
        As YAML.
    versions
        Of each program and library.
    counts
        Crossings and entries by minute, where lines or zones are counted. Without them the page
        shows by minute how many vehicles came.
    """

    source: Path
    folder: Path
    width: int
    height: int
    frames: int
    start: float
    end: float
    records: Sequence[VehicleRecord]
    thumbnails: Mapping[int, Thumbnail]
    levels: Levels
    still: Image | None
    player: Player | None
    most_vehicles: int
    settings: str
    versions: Mapping[str, str]
    counts: Sequence[Series] = ()

    @property
    def seconds(self) -> float:
        """How much of the video was searched."""
        return self.end - self.start


def video_page(report: VideoReport) -> str:
    """Return the page as HTML; it loads nothing but the video."""
    title = f"Vehicles in {escaped(report.source.name)}"
    subtitle = (
        f"{escaped(str(report.source))}: {clock(report.seconds)} at "
        f"{report.width} × {report.height} pixels, {report.frames} frames"
    )
    style = charts.STYLE + player.STYLE + _STYLE
    end = SCRIPT + facts_html(_facts(report))
    return page(title, subtitle, _sections(report), style=style, end=end)


def _facts(report: VideoReport) -> Facts:
    still = ""
    if report.still is not None:
        rows = max(1, round(report.still.shape[0] * _SMALL / report.still.shape[1]))
        small = cv2.resize(report.still, (_SMALL, rows), interpolation=cv2.INTER_AREA)
        still = jpeg_uri(small, 80)  # type: ignore[arg-type]  # uint8 stays uint8
    return Facts(
        seconds=max(0.0, report.seconds),
        frames=report.frames,
        vehicles=len(report.records),
        most=report.levels.most,
        still=still or "data:image/jpeg;base64,",
        counts={each.name: sum(each.by_minute.values()) for each in report.counts},
    )


def _sections(report: VideoReport) -> Iterator[str]:
    yield section("In short", cards(_figures(report)), player_html(report.player, report.folder))
    yield section("Vehicles over time", *_over_time(report))
    yield from _by_minute(report)
    if report.still is not None:
        yield section(
            "Where vehicles were",
            f'<img class="still" alt="heat over a frame of the video" '
            f'src="{jpeg_uri(report.still, 82)}">',
            paragraph("The ground that vehicles covered: the lighter, the longer."),
        )
    yield from _vehicles(report)
    yield section("Settings and versions", *_origin(report))


def _figures(report: VideoReport) -> list[tuple[str, str]]:
    shown = sum(record.seconds for record in report.records)
    classes = Counter(record.class_name for record in report.records if record.class_name)
    return [
        ("vehicles", str(len(report.records))),
        *((name, str(count)) for name, count in classes.most_common(4)),
        ("at once, at most", str(report.levels.most)),
        ("seconds each is shown, mean", f"{shown / max(1, len(report.records)):.1f}"),
        *((each.name, str(sum(each.by_minute.values()))) for each in report.counts),
    ]


def _shown(report: VideoReport) -> list[VehicleRecord]:
    """Return the vehicles that are shown one by one, in the order of their first time."""
    longest = sorted(report.records, key=lambda record: -record.seconds)[: report.most_vehicles]
    return sorted(longest, key=lambda record: (record.first, record.id))


def _over_time(report: VideoReport) -> Iterator[str]:
    if not report.records:
        yield paragraph("No vehicle was shown.")
        return
    yield paragraph("How many vehicles are shown at once.")
    levels = report.levels.steps(_STEPS)
    what = "number of vehicles at once over time"
    yield level_chart(levels, report.start, report.end, what)
    if spans := [
        Span(each.id, each.first, each.last, _sentence(each), _link(report, each.first))
        for each in _shown(report)
    ]:
        yield paragraph("From when to when each vehicle is shown.")
        yield span_chart(spans, report.start, report.end, "from when to when each is shown")


def _sentence(record: VehicleRecord) -> str:
    name = f" ({escaped(record.class_name)})" if record.class_name else ""
    return f"vehicle {record.id}{name}: {clock(record.first)} to {clock(record.last)}"


def _link(report: VideoReport, time: float) -> str:
    return jump(report.player, report.folder, time)


def _by_minute(report: VideoReport) -> Iterator[str]:
    first = int(report.start // 60)
    minutes = range(first, max(first + 1, math.ceil(report.end / 60)))
    if report.counts:
        chart = minute_chart(report.counts, minutes, "counts by minute")
        yield section("Counts by minute", chart)
    if len(minutes) == 1:  # the number of all vehicles says the same
        return
    came = Counter(int(record.first // 60) for record in report.records)
    chart = minute_chart([Series("vehicles that came", came)], minutes, "vehicles by minute")
    note = "A vehicle counts in the minute in which it came."
    yield section("Vehicles by minute", chart, paragraph(note))


def _vehicles(report: VideoReport) -> Iterator[str]:
    shown = _shown(report)
    if not shown:
        return
    left_out = len(report.records) - len(shown)
    note = f"The {len(shown)} of {len(report.records)} vehicles that are shown longest."
    notes = [paragraph(note)] if left_out else []
    tiles = "".join(_tile(report, record) for record in shown if record.id in report.thumbnails)
    if tiles:
        sheet = f'<div class="sheet vehicles" style="--tile: {_TILE}px">{tiles}</div>'
        yield section("What they looked like", *notes, sheet)
    yield section("Each vehicle", *notes, _table(report, shown))


def _tile(report: VideoReport, record: VehicleRecord) -> str:
    thumbnail = report.thumbnails[record.id]
    name = f", {escape(escaped(record.class_name))}" if record.class_name else ""
    return (
        f"<figure><a {_link(report, thumbnail.time)}>"
        f'<img decoding="async" alt="vehicle {record.id}{name}" src="{thumbnail.uri}">'
        f"<figcaption><b>#{record.id}{name}</b>{clock(thumbnail.time)}"
        "</figcaption></a></figure>"
    )


_HEADINGS = (
    *("id", "class", "from", "to", "seconds", "seen", "predicted", "mean score", "best score"),
    *("path, px", "path / width", "largest box, px"),
)


def _table(report: VideoReport, records: Sequence[VehicleRecord]) -> str:
    head = "".join(f"<th>{name}</th>" for name in _HEADINGS)
    body = "".join(_row(report, record) for record in records)
    table = f'<div class="wide vehicles-table"><table><tr>{head}</tr>{body}</table></div>'
    if len(records) > _MOST_ROWS:
        table = f"<details><summary>Show {len(records)} vehicles</summary>{table}</details>"
    return table + paragraph(
        "Times are those of the file of tracks. Seen and predicted are frames: where the detector "
        "saw the vehicle, and where it did not. The path is that of the middle of the box's lower "
        "edge."
    )


def _row(report: VideoReport, record: VehicleRecord) -> str:
    times = (
        f"<a {_link(report, time)}>{clock(time)}</a>" if report.player else clock(time)
        for time in (record.first, record.last)
    )
    cells = (
        f"#{record.id}",
        escape(escaped(record.class_name)) if record.class_name else "–",
        *times,
        f"{record.seconds:.1f}",
        str(record.seen),
        str(record.predicted),
        f"{record.mean_score:.2f}",
        f"{record.best_score:.2f}",
        f"{record.length:.0f}",
        f"{record.share:.2f}",
        f"{record.largest.width} × {record.largest.height}",
    )
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _origin(report: VideoReport) -> Iterator[str]:
    yield paragraph(", ".join(f"{name} {version}" for name, version in report.versions.items()))
    yield (
        f"<details><summary>All settings</summary><pre>{escape(report.settings)}</pre></details>"
    )
