"""The page of a video: when vehicles were there, where, what they looked like; and an index."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from vdet.boxes import Image
from vdet.conditions.finding import Finding
from vdet.errors import named
from vdet.files import write_text
from vdet.media import VideoInfo
from vdet.pages import charts
from vdet.pages.charts import Axis, Plot, Span, Timeline, clock
from vdet.pages.render import jpeg_uri, link_to, render
from vdet.pages.traffic import counts_by_interval, traffic_part
from vdet.traffic.counts import Counts
from vdet.traffic.paths import draw_paths
from vdet.traffic.records import VehicleRecord
from vdet.traffic.speeds import KMH

_MOST_VEHICLES = 300  # that are shown one by one
_SPEED_STEP = 5  # km/h, of the classes of speeds
_SMALL = 200  # columns of the still in the pages over many videos
_DOUBT = "#f3d9a4", "#333"  # colours of the row that says when the results are doubtful
_STOOD = {"standing": "standing", "unknown": "not seen moving"}
_NO_PICTURE = "data:image/jpeg;base64,"


class VideoFacts(BaseModel):
    """A video in numbers: pages over many videos are made from it.

    `seconds` is how much of the video was searched, `most` how many vehicles were shown at once.
    `counts` are by name, `conditions` say what makes them doubtful; `still` is a small picture as a
    data URI.
    """

    model_config = ConfigDict(frozen=True)

    seconds: float = Field(ge=0)
    frames: int = Field(ge=0)
    vehicles: int = Field(ge=0)
    most: int = Field(ge=0)
    still: str = Field(pattern=r"^data:image/jpeg;base64,[A-Za-z0-9+/=]*$")
    counts: dict[str, int] = {}
    conditions: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Player:
    """The video that a page shows.

    Attributes
    ----------
    name, address
        Its file name, and its address for the page.
    is_drawn
        Whether it is an output, with the vehicles drawn in; else it is the source.
    start
        Time of the frame with which it begins, seconds, as the tracks count it.
    """

    name: str
    address: str
    is_drawn: bool
    start: float

    def moment(self, time: float) -> str:
        """Return where the player stands at a time of the tracks, seconds."""
        return f"{max(0.0, time - self.start):.3f}"


@dataclass(frozen=True, slots=True)
class VideoPage:
    """What the page of a video shows.

    Attributes
    ----------
    start, end
        When the first frame is shown, and when the last one ends, seconds as in the tracks.
    thumbnails
        By id, the time of a frame in seconds, and the picture of the vehicle as a data URI. A
        vehicle may have none.
    poster
        The frame with the most vehicles, BGR uint8; None if there was no frame.
    settings
        The settings of the run as YAML.
    counts
        None where nothing is counted.
    interval
        That of the counts over time, seconds.
    gaps
        Times without frames, from the frame before to the one after, seconds.
    zero
        Second of the day at time 0; None where it is not known.
    findings
        What makes the results doubtful.
    """

    video: VideoInfo
    frames: int
    start: float
    end: float
    records: Sequence[VehicleRecord]
    thumbnails: Mapping[int, tuple[float, str]]
    poster: Image | None
    player: Player | None
    settings: str
    counts: Counts | None = None
    interval: int = 60
    gaps: Sequence[tuple[float, float]] = ()
    zero: float | None = None
    findings: Sequence[Finding] = ()

    @property
    def facts(self) -> VideoFacts:
        """The video in numbers."""
        return VideoFacts(
            seconds=max(0.0, self.seconds),
            frames=self.frames,
            vehicles=sum(record.has_driven for record in self.records),
            most=self.most,
            still=_NO_PICTURE if self.poster is None else jpeg_uri(self.poster, _SMALL),
            counts=self._totals,
            conditions=tuple(each.text for each in self.findings if each.severity == "warning"),
        )

    def html(self) -> str:
        """Return the page; it loads nothing but the video."""
        traffic = traffic_part(self.counts, self.records, self.poster) if self.counts else None
        return render("video.html", page=self, traffic=traffic)

    @property
    def _totals(self) -> dict[str, int]:
        """The number of vehicles in each direction of a line or zone that has some."""
        totals = self.counts.totals if self.counts else ()
        return {f"{each.name}: {each.direction}": each.count for each in totals if each.count}

    @property
    def seconds(self) -> float:
        """How much of the video was searched."""
        return self.end - self.start

    @property
    def spans(self) -> list[tuple[float, float]]:
        """When each vehicle is first and last shown, in the order of their first times."""
        return sorted((record.first, record.last) for record in self.records)

    @property
    def most(self) -> int:
        """The most vehicles at once."""
        return 1 + max(charts.pack(self.spans), default=-1)

    @property
    def figures(self) -> list[tuple[str, str]]:
        """The key figures."""
        count = sum(record.has_driven for record in self.records)
        stood = Counter(each.motion for each in self.records if not each.has_driven)
        shown = sum(record.seconds for record in self.records) / max(1, len(self.records))
        classes = Counter(
            each.class_name for each in self.records if each.class_name and each.has_driven
        )
        return [
            (named(count, "vehicle"), str(count)),
            *((named(n, name), str(n)) for name, n in classes.most_common(4)),
            *((_STOOD[motion], str(n)) for motion, n in stood.items() if motion in _STOOD),
            ("most at once", str(self.most)),
            ("mean seconds shown", f"{shown:.1f}"),
            *((name, str(count)) for name, count in self._totals.items()),
        ]

    @property
    def shown(self) -> list[VehicleRecord]:
        """The vehicles that are shown one by one, in the order of their first time."""
        longest = sorted(self.records, key=lambda record: -record.seconds)[:_MOST_VEHICLES]
        return sorted(longest, key=lambda record: (record.first, record.id))

    @property
    def level_plot(self) -> Plot:
        """How many vehicles are shown at once."""
        title = "Number of vehicles at once"
        return charts.level_plot(self.spans, self._times, title, self.gaps)

    @property
    def timeline(self) -> Timeline:
        """When each vehicle is shown; those that are not there at once share a row."""
        shown = self.shown
        rows = charts.pack((record.first, record.last) for record in shown)
        doubts = [
            Span(0, first, last, each.text, *_DOUBT, each.code, first)
            for each in self.findings
            for first, last in each.spans
        ]
        above = bool(doubts)  # their row is the first one
        spans = [
            span
            for each, row in zip(shown, rows, strict=True)
            for span in _spans(each, row + above)
        ]
        return Timeline("When each vehicle is shown", self._times, [*doubts, *spans])

    @property
    def interval_plots(self) -> list[Plot]:
        """Vehicles, and the counts of lines and zones, by interval."""
        step = self.interval
        came = Counter(int(record.first // step) for record in self.records)
        counted = counts_by_interval(self.counts, step) if self.counts else {}
        series = {"First seen": {"vehicles": came}, "At lines and zones": counted}
        ends = step * (self.start // step), step * math.ceil(self.end / step)
        x = charts.time_axis(*ends, self.zero)
        return [charts.interval_plot(some, x, step, name) for name, some in series.items() if some]

    @property
    def speed_plot(self) -> Plot | None:
        """How many vehicles have which speed; None where none is known."""
        known = [KMH * each.speeds.quantile(0.5) for each in self.records if each.speeds]
        title = "Vehicles by their median speed"
        return charts.histogram(known, _SPEED_STEP, title, "km/h") if known else None

    @property
    def paths(self) -> Image | None:
        """The frame with the paths of all vehicles."""
        if self.poster is None:
            return None
        drawn = self.poster.copy()
        draw_paths(drawn, self.records)
        return drawn

    @property
    def _times(self) -> Axis:
        return charts.time_axis(self.start, self.end, self.zero)


def _spans(record: VehicleRecord, row: int) -> list[Span]:
    """Return a bar for each time in which a vehicle is shown and not lost; the longest is named."""
    name = f" ({record.class_name})" if record.class_name else ""
    title = f"vehicle {record.id}{name}: {clock(record.first)} to {clock(record.last)}"
    fill, ink = charts.vehicle_colors(record.id)
    longest = max(record.followed, key=lambda span: span[1] - span[0])
    return [
        Span(row, *span, title, fill, ink, f"#{record.id}" if span is longest else "", span[0])
        for span in record.followed
    ]


def write_index(videos: Sequence[tuple[str, Path, VideoFacts]], target: Path) -> None:
    """Write the page over many videos: each has a name, a page as seen from it, and facts."""
    counts: Counter[str] = Counter()
    for _, _, facts in videos:
        counts.update(facts.counts)
    linked = [(name, link_to(page, Path()), facts) for name, page, facts in videos]
    write_text(target, render("index.html", videos=linked, counts=counts))
