"""The page of a video: when vehicles were there, where, what they looked like; and an index."""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vdet.errors import OutputError
from vdet.media import VideoInfo
from vdet.media.images import Image
from vdet.pages import charts
from vdet.pages.charts import Minutes, Plot, Span, Timeline, clock
from vdet.pages.render import PAGE_NAME, jpeg_uri, link_to, named, render, write_page
from vdet.traffic.records import VehicleRecord

_MOST_VEHICLES = 300  # that are shown one by one
_SMALL = 200  # columns of the still in the pages over many videos
_NO_PICTURE = "data:image/jpeg;base64,"
_BLOCK = re.compile(r'<script type="application/json" id="vdet">(.*?)</script>', re.DOTALL)


class VideoFacts(BaseModel):
    """A video in numbers, as data in its page: pages over many videos are made from it.

    `seconds` is how much of the video was searched, `most` how many vehicles were shown at once.
    `counts` are by name; `still` is a small picture as a data URI.
    """

    model_config = ConfigDict(frozen=True)

    seconds: float = Field(ge=0)
    frames: int = Field(ge=0)
    vehicles: int = Field(ge=0)
    most: int = Field(ge=0)
    still: str = Field(pattern=r"^data:image/jpeg;base64,[A-Za-z0-9+/=]*$")
    counts: dict[str, int] = {}


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
    poster, still
        A frame, and the same with the heat over it, BGR uint8; None if there was no frame.
    settings
        The settings of the run as YAML.
    counts
        Crossings and entries by minute, where lines or zones are counted.
    """

    video: VideoInfo
    frames: int
    start: float
    end: float
    records: Sequence[VehicleRecord]
    thumbnails: Mapping[int, tuple[float, str]]
    poster: Image | None
    still: Image | None
    player: Player | None
    settings: str
    counts: Minutes

    def html(self) -> str:
        """Return the page; it loads nothing but the video."""
        facts = VideoFacts(
            seconds=max(0.0, self.seconds),
            frames=self.frames,
            vehicles=len(self.records),
            most=self.most,
            still=_NO_PICTURE if self.still is None else jpeg_uri(self.still, _SMALL),
            counts={name: minutes.total() for name, minutes in self.counts.items()},
        )
        return render("video.html", page=self, facts=facts.model_dump())

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
            *((name, str(minutes.total())) for name, minutes in self.counts.items()),
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
        return charts.level_plot(self.spans, self.start, self.end, title)

    @property
    def timeline(self) -> Timeline:
        """When each vehicle is shown; those that are not there at once share a row."""
        shown = self.shown
        rows = charts.pack((record.first, record.last) for record in shown)
        spans = list(map(_span, shown, rows))
        return Timeline("When each vehicle is shown", charts.time_axis(self.start, self.end), spans)

    @property
    def minute_plots(self) -> list[Plot]:
        """Vehicles, and the counts of lines and zones, by minute."""
        came = Counter(int(record.first // 60) for record in self.records)
        series = {"First seen": {"vehicles": came}, "At lines and zones": self.counts}
        x = charts.time_axis(60 * (self.start // 60), 60 * math.ceil(self.end / 60))
        return [charts.minute_plot(some, x, title) for title, some in series.items() if some]


def _span(record: VehicleRecord, row: int) -> Span:
    name = f" ({record.class_name})" if record.class_name else ""
    title = f"vehicle {record.id}{name}: {clock(record.first)} to {clock(record.last)}"
    fill, ink = charts.vehicle_colors(record.id)
    label = f"#{record.id}"
    return Span(row, record.first, record.last, title, fill, ink, label, record.first)


def read_facts(page: Path) -> VideoFacts:
    """Return what a page knows. Raises `OutputError` if it is no page of a video."""
    try:
        found = _BLOCK.search(page.read_text(encoding="utf-8"))
        return VideoFacts.model_validate_json(found.group(1) if found else "")
    except (UnicodeDecodeError, ValidationError) as error:
        message = f"{page}: is no page of vdet on a video; remove it, and run again"
        raise OutputError(message) from error


def write_index(outputs: Mapping[str, Path], target: Path) -> None:
    """Write the page over many videos; `outputs` are the folders of their pages by their names.

    A folder without a page is left out.

    Raises
    ------
    OutputError
        A page was not written by this program.
    """
    pages = {name: folder / PAGE_NAME for name, folder in outputs.items()}
    videos = [
        (name, link_to(page, target.parent), read_facts(page))
        for name, page in pages.items()
        if page.is_file()
    ]
    counts: Counter[str] = Counter()
    for _, _, facts in videos:
        counts.update(facts.counts)
    write_page(render("index.html", videos=videos, counts=counts), target)
