"""The page of a video: which vehicles appear, when, where, and their images; pages over many."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

from vdet.boxes import Image
from vdet.config.classes import UNKNOWN
from vdet.config.loading import render_settings
from vdet.config.schema import Settings
from vdet.draw import color_of, text_color
from vdet.errors import plural
from vdet.files import write_text
from vdet.findings import Finding
from vdet.media import VideoInfo
from vdet.pages.render import (
    PAGE_NAME,
    Axis,
    Bar,
    Plot,
    hex_color,
    interval_plot,
    jpeg_uri,
    link_to,
    pack_rows,
    render,
    time_axis,
    time_text,
)
from vdet.pages.traffic import page_table, path_marks, scene_picture, with_marks
from vdet.traffic.clock import Clock, Intervals, Span
from vdet.traffic.counts import Counts
from vdet.traffic.records import COLUMNS, VehicleRecord
from vdet.traffic.survey import Survey

_INTERVAL = 60  # seconds of an interval of the charts, unless the settings have one
_MAX_VEHICLES = 300  # in the timeline, and with pictures
_DOUBT = "#f3d9a4", "#333"  # colours of the row with doubtful times
_STOOD = {"standing": "standing", "unknown": "not seen moving"}
_SIDES = "left", "middle", "right"
_NEAR = 0.1  # width of a near vehicle, as a fraction of the frame's
_SMALL = 200  # longer side of the thumbnail on the page over many videos
NO_STILL = "data:image/jpeg;base64,"
"""Thumbnail of a video without a frame."""
_COLUMNS = (
    *("id", "first", "seconds", "speed", "lines", "motion", "distance", "lane"),
    *("side", "size", "certainty"),
)
_EMPTY = (None, "")
Row = Mapping[str, Any]
"""A vehicle in the table of a video or of a batch.

Its columns are those of records, and `class_name`; `lines`, the lines and zones where it was
counted, in order; `side` and `size`, where its largest box is in the picture; `certainty`, "sure"
if `VehicleRecord.is_sure`, else "unsure"; `picture` and `clip`, their addresses relative to the
page of its video. Unknown values are None or empty.
"""
Summaries = Mapping[str, Mapping[str, Any]]
"""The `summary` of an output of each video, by its name; `page` is relative to its folder."""


@dataclass(frozen=True, slots=True)
class Player:
    """The video on a page.

    Attributes
    ----------
    name, address
        Its file name, and its address relative to the page.
    is_drawn
        Whether it is the output with boxes drawn, or the source.
    start
        Time of its first frame in the tracks, seconds.
    """

    name: str
    address: str
    is_drawn: bool
    start: float

    def position(self, time: float) -> str:
        """Return the position of the player at a time in the tracks, seconds."""
        return f"{max(0.0, time - self.start):.3f}"


@dataclass(frozen=True, slots=True)
class VideoPage:
    """The content of the page of a video.

    Attributes
    ----------
    spans
        The parts with video, from the first to the last frame, seconds as in the tracks.
    thumbnails
        By id, the image of the vehicle as a data URI. A vehicle may have none.
    poster, still
        The frame with the most vehicles, BGR uint8, and a copy with their boxes; None without
        frames.
    survey
        The counts; None if nothing is counted.
    clock
        Start time of the video; None if unknown.
    pictures
        By id, the address of the image of a vehicle relative to the page.
    findings
        Reasons to doubt the results.
    clips
        By id, the address of a clip that shows a vehicle, as in `pictures`.
    review
        The address of the review of the counts; empty if the run writes none.
    index
        The address of the page over all videos of a batch; empty without one.
    """

    video: VideoInfo
    frames: int
    spans: Sequence[Span]
    records: Sequence[VehicleRecord]
    thumbnails: Mapping[int, str]
    poster: Image | None
    still: Image | None
    player: Player | None
    settings: Settings
    survey: Survey | None = None
    clock: Clock | None = None
    pictures: Mapping[int, str] = field(default_factory=dict)
    findings: Sequence[Finding] = ()
    clips: Mapping[int, str] = field(default_factory=dict)
    review: str = ""
    index: str = ""

    @property
    def counts(self) -> Counts | None:
        """The counts of the survey."""
        return self.survey.counts[0] if self.survey else None

    @property
    def summary(self) -> dict[str, Any]:
        """What the page over many videos shows of this one, as values for JSON."""
        return {
            **self._table(self.pictures),
            "seconds": max(0.0, self.seconds),
            "frames": self.frames,
            "vehicles": len(self._moved),
            "max_at_once": self._max_at_once,
            "still": NO_STILL if self.still is None else jpeg_uri(self.still, _SMALL),
            "counts": self._totals,
            "conditions": [item.text for item in self.findings if item.severity == "warning"],
            "review": self.review,
        }

    @property
    def _moved(self) -> list[VehicleRecord]:
        """The vehicles that drove."""
        return [record for record in self.records if record.has_moved]

    @property
    def _max_at_once(self) -> int:
        """The maximum number of vehicles at once."""
        spans = sorted((record.first, record.last) for record in self.records)
        return 1 + max(pack_rows(spans), default=-1)

    @property
    def _totals(self) -> dict[str, int]:
        """The number of vehicles in each direction of a line or zone, without zeros."""
        totals = self.counts.totals if self.counts else ()
        return {f"{total.name}: {total.direction}": total.count for total in totals if total.count}

    def _table(self, pictures: Mapping[int, str]) -> dict[str, Any]:
        """Return what the table needs; `pictures` has addresses of images by vehicle id."""
        lines: dict[int, dict[str, None]] = {}
        for event in self.counts.events if self.counts else ():
            lines.setdefault(event.id, {})[event.name] = None
        rows = [
            {
                **{name: COLUMNS[name](record) for name in ("id", "speed", "distance", "lane")},
                "class_name": record.class_name,
                "first": round(record.first, 3),
                "seconds": round(record.seconds, 1),
                "clock": self.clock and self.clock.at(record.first).isoformat(timespec="seconds"),
                "lines": " → ".join(lines.get(record.id, ())),
                "motion": record.motion or "",
                "side": _SIDES[min(2, int(3 * record.largest.center[0] / record.frame_width))],
                "size": "near" if record.largest.width > _NEAR * record.frame_width else "far",
                "certainty": "sure" if record.is_sure else "unsure",
                "picture": pictures.get(record.id, ""),
                "clip": self.clips.get(record.id, ""),
            }
            for record in self.records
        ]
        start = self.player.start if self.player else 0.0
        return {"plays": self.player is not None, "start": start, "rows": rows}

    def html(self) -> str:
        """Return the page; it loads only the video."""
        shown = longest(self.records)
        x = time_axis(self.spans[0][0], self.end, self.clock.at if self.clock else None)
        settings = self.settings.with_paths(lambda path: Path(path).name)
        return render(
            "video.html",
            page=self,
            index=self.index,
            figures=self._figures(),
            shown=shown,
            time_axis=x,
            timeline=_timeline(shown, self.findings),
            interval_plots=self._interval_plots(x),
            directions=self.survey and page_table(self.survey.volumes()),
            flows=self.survey and page_table(self.survey.flows()),
            color_of=color_of,
            traffic=self._traffic(),
            paths=self._paths(),
            table=table_json([ListedVideo("", "", self._table(self.thumbnails))]),
            settings=render_settings(settings),
        )

    @property
    def gaps(self) -> list[Span]:
        """Times without frames, from the frame before to the one after, seconds."""
        return [(end, start) for (_, end), (start, _) in pairwise(self.spans)]

    @property
    def end(self) -> float:
        """End of the last frame, seconds."""
        return self.spans[-1][1] + float(1 / self.video.rate)

    @property
    def seconds(self) -> float:
        """The duration of the processed part of the video."""
        return self.end - self.spans[0][0]

    def _figures(self) -> list[tuple[str, str]]:
        """Return the key figures."""
        shown = sum(record.seconds for record in self.records) / max(1, len(self.records))
        stood = Counter(record.motion for record in self.records if not record.has_moved)
        driven = self._moved
        names = (record.class_name for record in driven)
        classes = Counter(name for name in names if name and name != UNKNOWN)
        return [
            (plural(len(driven), "vehicle"), str(len(driven))),
            *((plural(n, name), str(n)) for name, n in classes.most_common(4)),
            *((_STOOD[motion], str(n)) for motion, n in stood.items() if motion in _STOOD),
            ("maximum at once", str(self._max_at_once)),
            ("mean seconds in view", f"{shown:.1f}"),
            *((name, str(count)) for name, count in self._totals.items()),
        ]

    def _interval_plots(self, x: Axis) -> list[Plot]:
        """Return plots of vehicles and of counts by the intervals of the tables.

        There are none if there is only one interval.
        """
        length = self.settings.traffic.seconds or _INTERVAL
        to_clock = self.clock.at if self.clock else None
        intervals = Intervals([(self.clock, self.spans)], length)
        if len(intervals.periods) == 1:
            return []
        seen = [(record.class_name or UNKNOWN, record.first) for record in self._moved]
        events = self.counts.events if self.counts else ()
        counted = [(f"{event.name}: {event.direction}", event.time) for event in events]
        plots = []
        for title, items in (("First seen", seen), ("At lines and zones", counted)):
            series: dict[str, Counter[float]] = {name: Counter() for name, _ in items}
            for name, time in items:
                series[name][intervals.start_in(0, intervals.number(0, time))] += 1
            plots += [interval_plot(series, x, length, title, to_clock)] if series else []
        return plots

    def _traffic(self) -> Image | None:
        """Return the poster with lines, zones and flows."""
        if self.poster is None or not self.survey:
            return None
        paths = {record.id: record.path for record in self.records}
        return scene_picture(self.poster, self.settings.traffic, self.survey.counts, paths)

    def _paths(self) -> Image | None:
        """Return the poster with the paths of all vehicles; None if the camera moves."""
        if self.poster is None or any(item.code == "camera-moves" for item in self.findings):
            return None
        height, width = self.poster.shape[:2]
        return with_marks(self.poster, path_marks(self.records, (width, height)))


def longest(records: Sequence[VehicleRecord]) -> list[VehicleRecord]:
    """Return the vehicles to show one by one: those shown longest, in the order of their times."""
    first = sorted(records, key=lambda record: -record.seconds)[:_MAX_VEHICLES]
    return sorted(first, key=lambda record: (record.first, record.id))


def _timeline(shown: Sequence[VehicleRecord], findings: Sequence[Finding]) -> list[Bar]:
    """Return bars of when each vehicle is shown; vehicles that are not simultaneous share rows.

    The first row has the times at which the results are doubtful, if any.
    """
    fill, ink = _DOUBT
    bars = [
        Bar(first, last, 0, 1, fill, finding.text, finding.code, ink)
        for finding in findings
        for first, last in finding.spans
    ]
    top, rows = bool(bars), pack_rows((record.first, record.last) for record in shown)
    for record, row in zip(shown, rows, strict=True):
        bars += _vehicle_bars(record, top + row)
    return bars


def _vehicle_bars(record: VehicleRecord, row: int) -> list[Bar]:
    """Return a bar for each time span in which a vehicle is tracked; the longest is labelled."""
    kind = f" ({record.class_name})" if record.class_name else ""
    times = f"{time_text(record.first)} to {time_text(record.last)}"
    fill = color_of(record.id)
    longest = max(record.followed, key=lambda span: span[1] - span[0])
    return [
        Bar(
            *span,
            row,
            row + 1,
            color=hex_color(fill),
            title=f"vehicle {record.id}{kind}: {times}",
            label=f"#{record.id}" if span is longest else "",
            ink=hex_color(text_color(fill)),
        )
        for span in record.followed
    ]


@dataclass(frozen=True, slots=True)
class ListedVideo:
    """A video of a table or of a list.

    Attributes
    ----------
    name
        Name of the video.
    address
        Address of its page; empty for this page.
    facts
        Its summary.
    """

    name: str
    address: str
    facts: Mapping[str, Any]

    @property
    def folder(self) -> str:
        """Prefix of addresses that are relative to the page."""
        return self.address.removesuffix(PAGE_NAME)


def table_json(videos: Sequence[ListedVideo]) -> str:
    """Return the columns of the table for `vehicles.js`, which filters and sorts it.

    Empty columns are omitted. `counts` has the number of rows of each video.
    """
    rows = [(video.folder, row) for video in videos for row in video.facts["rows"]]
    columns: dict[str, list[Any]] = {
        "class": [row["class_name"] or UNKNOWN for _, row in rows],
        **{name: [row[name] for _, row in rows] for name in _COLUMNS},
        "clock": [_plain_seconds(row["clock"]) for _, row in rows],
        "picture": [row["picture"] and folder + row["picture"] for folder, row in rows],
        "clip": [row["clip"] and folder + row["clip"] for folder, row in rows],
    }
    table = {
        "names": [video.name for video in videos],
        "pages": [video.address for video in videos],
        "plays": [video.facts["plays"] for video in videos],
        "starts": [video.facts["start"] for video in videos],
        "counts": [len(video.facts["rows"]) for video in videos],
        # Without rows, all columns are kept.
        **{name: values for name, values in columns.items() if not rows or {*values} - {*_EMPTY}},
    }
    text = json.dumps(table, separators=(",", ":"), ensure_ascii=False)
    return text.replace("<", "\\u003c")  # so that nothing in it ends the enclosing element


def _plain_seconds(clock: str | None) -> int | None:
    """Return a clock time as seconds since 1970, ignoring its zone."""
    if clock is None:
        return None
    return round(datetime.fromisoformat(clock).replace(tzinfo=UTC).timestamp())


def _listing(videos: Summaries) -> dict[str, Any]:
    """Return the `videos` of a list, and the errors of those that `failed`."""
    failed = {name: values["error"] for name, values in videos.items() if "error" in values}
    listed = [
        ListedVideo(name, link_to(Path(name).parent / values["page"], Path()), values)
        for name, values in videos.items()
        if name not in failed
    ]
    return {"videos": listed, "failed": failed}


def write_index(videos: Summaries, target: Path) -> None:
    """Write the page over many videos, from the summaries of their pages.

    A video that failed has its `error` instead.
    """
    listing = _listing(videos)
    counts = sum((Counter(video.facts["counts"]) for video in listing["videos"]), Counter[str]())
    table = table_json(listing["videos"])
    write_text(target, render("index.html", **listing, counts=counts, table=table))


def write_reviews(videos: Summaries, target: Path) -> None:
    """Write the list of reviews of many videos, from the summaries of these."""
    write_text(target, render("reviews.html", **_listing(videos)))
