"""The page of a video: when vehicles were there, where, and what they looked like."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from vdet.boxes import Image
from vdet.errors import named
from vdet.media import VideoInfo
from vdet.pages import charts
from vdet.pages.batch import NO_STILL, VehicleRow, VideoFacts
from vdet.pages.charts import Axis, Plot, Span, Timeline, clock
from vdet.pages.render import jpeg_uri, render
from vdet.pages.traffic import counts_by_interval, traffic_part
from vdet.traffic.clock import Clock
from vdet.traffic.counts import Counts
from vdet.traffic.paths import draw_paths
from vdet.traffic.records import VehicleRecord
from vdet.traffic.speeds import KMH

_MOST_VEHICLES = 300  # that are shown one by one
_SPEED_STEP = 5  # km/h, of the classes of speeds
_SMALL = 200  # columns of the still in the pages over many videos


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
    clock
        When the video begins; None where it is not known.
    pictures
        By id, the address of the picture of a vehicle as seen from the page, where the run writes
        one.
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
    clock: Clock | None = None
    pictures: Mapping[int, str] = field(default_factory=dict)

    @property
    def facts(self) -> VideoFacts:
        """The video in numbers."""
        return VideoFacts(
            seconds=max(0.0, self.seconds),
            frames=self.frames,
            vehicles=len(self.records),
            most=self.most,
            still=NO_STILL if self.poster is None else jpeg_uri(self.poster, _SMALL),
            counts=self._totals,
            rows=tuple(self._row(record) for record in self.records),
        )

    def _row(self, record: VehicleRecord) -> VehicleRow:
        events = self.counts.events if self.counts else ()
        names = [event.name for event in events if event.id == record.id]
        return VehicleRow(
            class_name=record.class_name,
            first=round(record.first, 3),
            moment=self.player.moment(record.first) if self.player else "0",
            seconds=round(record.seconds, 1),
            clock=self.clock and self.clock.at(record.first).isoformat(timespec="seconds"),
            speed=round(KMH * record.speeds.quantile(0.5), 1) if record.speeds else None,
            way=" → ".join(dict.fromkeys(names)),
            picture=self.pictures.get(record.id, ""),
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
        count = len(self.records)
        shown = sum(record.seconds for record in self.records) / max(1, count)
        classes = Counter(record.class_name for record in self.records if record.class_name)
        return [
            (named(count, "vehicle"), str(count)),
            *((named(n, name), str(n)) for name, n in classes.most_common(4)),
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
        spans = [span for each, row in zip(shown, rows, strict=True) for span in _spans(each, row)]
        return Timeline("When each vehicle is shown", self._times, spans)

    @property
    def interval_plots(self) -> list[Plot]:
        """Vehicles, and the counts of lines and zones, by interval."""
        step = self.interval
        came = Counter(int(record.first // step) for record in self.records)
        counted = counts_by_interval(self.counts, step) if self.counts else {}
        series = {"First seen": {"vehicles": came}, "At lines and zones": counted}
        ends = step * (self.start // step), step * math.ceil(self.end / step)
        x = charts.time_axis(*ends, self._zero)
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
    def _zero(self) -> float | None:
        """The second of the day at time 0, if it is known."""
        return self.clock.second_of_day if self.clock else None

    @property
    def _times(self) -> Axis:
        return charts.time_axis(self.start, self.end, self._zero)


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
