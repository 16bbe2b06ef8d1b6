"""The page of a video: when vehicles were there, where, what they looked like."""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vdet.errors import OutputError
from vdet.media.images import Image
from vdet.pages.charts import (
    Plot,
    Series,
    Span,
    Timeline,
    clock,
    level_plot,
    minute_plot,
    pack,
    time_axis,
    vehicle_colors,
)
from vdet.pages.render import jpeg_uri, link_to, plural, render
from vdet.traffic.levels import Levels
from vdet.traffic.records import VehicleRecord

_STEPS = 160  # of the chart of levels
_SMALL = 200  # columns of the still in the pages over many videos
_BLOCK = re.compile(r'<script type="application/json" id="vdet">(.*?)</script>', re.DOTALL)


class Facts(BaseModel):
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
class Thumbnail:
    """The picture of a vehicle as a data URI, and the time of its frame in seconds."""

    time: float
    uri: str


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

    @staticmethod
    def of(path: Path, folder: Path, *, is_drawn: bool, start: float) -> "Player":
        """Return the player of a file for a page in `folder`."""
        return Player(path.name, link_to(path, folder), is_drawn, start)

    def moment(self, time: float) -> str:
        """Return where the player stands at a time of the tracks, seconds."""
        return f"{max(0.0, time - self.start):.3f}"


@dataclass(frozen=True, slots=True)
class VideoPage:
    """What the page of a video shows.

    Attributes
    ----------
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
        Crossings and entries by minute, where lines or zones are counted.
    """

    source: Path
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

    def html(self) -> str:
        """Return the page; it loads nothing but the video."""
        return render("video.html", page=self, facts=self._facts().model_dump(mode="json"))

    def _facts(self) -> Facts:
        still = "data:image/jpeg;base64,"
        if self.still is not None:
            rows = max(1, round(self.still.shape[0] * _SMALL / self.still.shape[1]))
            small = cv2.resize(self.still, (_SMALL, rows), interpolation=cv2.INTER_AREA)
            still = jpeg_uri(np.asarray(small, np.uint8), 80)
        return Facts(
            seconds=max(0.0, self.seconds),
            frames=self.frames,
            vehicles=len(self.records),
            most=self.levels.most,
            still=still,
            counts={each.name: each.total for each in self.counts},
        )

    @property
    def seconds(self) -> float:
        """How much of the video was searched."""
        return self.end - self.start

    @property
    def figures(self) -> list[tuple[str, str]]:
        """The key figures."""
        count = len(self.records)
        shown = sum(record.seconds for record in self.records) / max(1, count)
        classes = Counter(record.class_name for record in self.records if record.class_name)
        return [
            ("vehicle" if count == 1 else "vehicles", str(count)),
            *((plural(name) if n != 1 else name, str(n)) for name, n in classes.most_common(4)),
            ("most at once", str(self.levels.most)),
            ("mean seconds shown", f"{shown:.1f}"),
            *((each.name, str(each.total)) for each in self.counts),
        ]

    @property
    def shown(self) -> list[VehicleRecord]:
        """The vehicles that are shown one by one, in the order of their first time."""
        longest = sorted(self.records, key=lambda record: -record.seconds)[: self.most_vehicles]
        return sorted(longest, key=lambda record: (record.first, record.id))

    @property
    def level_plot(self) -> Plot:
        """How many vehicles are shown at once."""
        levels = self.levels.steps(_STEPS)
        return level_plot(levels, self.start, self.end, "number of vehicles at once over time")

    @property
    def timeline(self) -> Timeline:
        """From when to when each vehicle is shown; those that are not there at once share a row."""
        rows = pack((record.first, record.last) for record in self.shown)
        spans = [_span(record, row) for record, row in zip(self.shown, rows, strict=True)]
        what = "from when to when each vehicle is shown"
        return Timeline(what, time_axis(self.start, self.end), spans)

    @property
    def minutes(self) -> range:
        """The minutes of the video that were searched."""
        first = int(self.start // 60)
        return range(first, max(first + 1, math.ceil(self.end / 60)))

    @property
    def count_plot(self) -> Plot:
        """The counts of lines and zones by minute."""
        return minute_plot(self.counts, self.minutes, "counts by minute")

    @property
    def vehicle_plot(self) -> Plot:
        """The vehicles by the minute in which they came."""
        came = Counter(int(record.first // 60) for record in self.records)
        return minute_plot([Series("new vehicles", came)], self.minutes, "vehicles by minute")


def _span(record: VehicleRecord, row: int) -> Span:
    name = f" ({record.class_name})" if record.class_name else ""
    title = f"vehicle {record.id}{name}: {clock(record.first)} to {clock(record.last)}"
    fill, ink = vehicle_colors(record.id)
    label = f"#{record.id}"
    return Span(row, record.first, record.last, title, fill, ink, label, record.first)


def read_facts(page: Path) -> Facts:
    """Return what a page knows. Raises `OutputError` if it is no page of a video."""
    try:
        found = _BLOCK.search(page.read_text(encoding="utf-8"))
        return Facts.model_validate_json(found.group(1) if found else "")
    except (UnicodeDecodeError, ValidationError) as error:
        message = f"{page}: is no page of vdet on a video; remove it, and run again"
        raise OutputError(message) from error
