"""The pages over the videos of a batch, and the table of vehicles on all pages.

`vehicles.js` filters and sorts the table in the browser.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from vdet.config.classes import UNKNOWN
from vdet.files import write_text
from vdet.pages.render import PAGE_NAME, link_to, render

NO_STILL = "data:image/jpeg;base64,"
"""Thumbnail of a video without a frame."""
_COLUMNS = (
    *("id", "first", "seconds", "speed", "lines", "motion", "distance", "lane"),
    *("side", "size"),
)
_EMPTY = (None, "")
Summaries = Mapping[str, Mapping[str, Any]]
"""The `summary` of an output of each video, by its name; `page` is relative to its folder."""
FactsT = TypeVar("FactsT", bound=BaseModel)


class VehicleRow(BaseModel):
    """A vehicle in the table of a video or of a batch.

    Attributes
    ----------
    first
        When it is first shown, seconds in the video.
    seconds
        How long it is shown.
    clock
        `first` as a clock time, ISO 8601; None if unknown.
    speed
        Median speed, km/h; None if unknown.
    lines
        The lines and zones where it was counted, in order.
    motion
        Whether it drove or stood, as in records; empty if unknown.
    distance, lane
        As in records; None if unknown.
    side, size
        Where its largest box is in the picture: left, middle or right; near or far, by its width.
    picture, clip
        Address of its image, and of a clip that shows it, relative to the page of its video; empty
        if there is none.
    """

    model_config = ConfigDict(frozen=True)

    id: int
    class_name: str | None
    first: float
    seconds: float
    clock: str | None = None
    speed: float | None = None
    lines: str = ""
    motion: str = ""
    distance: float | None = None
    lane: int | None = None
    side: str = ""
    size: str = ""
    picture: str = ""
    clip: str = ""


class VideoFacts(BaseModel):
    """Key figures of a video, for the page over many videos.

    `seconds` is the duration of the processed part, `max_at_once` the maximum number of vehicles
    at a time. `counts` are by name, `conditions` are reasons to doubt them; `still` is a thumbnail
    as a data URI. The player of its page begins at `start`, seconds in the video. `review` is the
    address of the review of its counts relative to its page, if there is one.
    """

    model_config = ConfigDict(frozen=True)

    start: float = 0.0
    seconds: float = Field(ge=0)
    frames: int = Field(ge=0)
    vehicles: int = Field(ge=0)
    max_at_once: int = Field(ge=0)
    still: str = Field(pattern=r"^data:image/jpeg;base64,[A-Za-z0-9+/=]*$")
    counts: dict[str, int] = {}
    conditions: tuple[str, ...] = ()
    rows: tuple[VehicleRow, ...] = ()
    review: str = ""


class ReviewFacts(BaseModel):
    """What the list of reviews shows of one: its key in the storage of the browser, and numbers."""

    key: str
    vehicles: int
    minutes: int


@dataclass(frozen=True, slots=True)
class VideoRows:
    """The vehicles of a video.

    Attributes
    ----------
    name
        Name of the video.
    page
        Address of its page: empty for this page, None if it has no player.
    start
        Time in the video at which the player begins, seconds.
    """

    name: str
    page: str | None
    start: float
    rows: Sequence[VehicleRow]

    def addresses(self, column: str) -> list[str]:
        """Return the addresses in a column of the rows, relative to the page of the table."""
        folder = (self.page or "").removesuffix(PAGE_NAME)
        return [getattr(row, column) and folder + getattr(row, column) for row in self.rows]


def table_json(parts: Sequence[VideoRows]) -> str:
    """Return the columns of the table for `vehicles.js`.

    Empty columns are omitted. `counts` has the number of rows of each video.
    """
    rows = [row for part in parts for row in part.rows]
    columns: dict[str, list[Any]] = {
        "class": [row.class_name or UNKNOWN for row in rows],
        **{name: [getattr(row, name) for row in rows] for name in _COLUMNS},
        "clock": [_plain_seconds(row.clock) for row in rows],
        "picture": [address for part in parts for address in part.addresses("picture")],
        "clip": [address for part in parts for address in part.addresses("clip")],
    }
    table = {
        "names": [part.name for part in parts],
        "pages": [part.page for part in parts],
        "starts": [part.start for part in parts],
        "counts": [len(part.rows) for part in parts],
        **{name: values for name, values in columns.items() if _has_values(values)},
    }
    text = json.dumps(table, separators=(",", ":"), ensure_ascii=False)
    return text.replace("<", "\\u003c")  # so that nothing in it ends the enclosing element


def _has_values(column: Sequence[Any]) -> bool:
    """Return whether a column has a value; without rows, all columns are kept."""
    return not column or any(value not in _EMPTY for value in column)


def _plain_seconds(clock: str | None) -> int | None:
    """Return a clock time as seconds since 1970, ignoring its zone."""
    if clock is None:
        return None
    return round(datetime.fromisoformat(clock).replace(tzinfo=UTC).timestamp())


@dataclass(frozen=True, slots=True)
class _Listed(Generic[FactsT]):
    """A video in a list, with the address of its page."""

    name: str
    address: str
    facts: FactsT

    @property
    def folder(self) -> str:
        """Prefix of addresses that are relative to the page."""
        return self.address.removesuffix(PAGE_NAME)


def _listed(videos: Summaries, facts: type[FactsT]) -> list[_Listed[FactsT]]:
    """Return the videos that did not fail."""
    return [
        _Listed(name, link_to(Path(name).parent / values["page"], Path()), facts(**values))
        for name, values in videos.items()
        if "error" not in values
    ]


def _errors(videos: Summaries) -> dict[str, str]:
    return {name: values["error"] for name, values in videos.items() if "error" in values}


def write_index(videos: Summaries, target: Path) -> None:
    """Write the page over many videos, from the `page` of each and its `VideoFacts`.

    A video that failed has its `error` instead.
    """
    listed = _listed(videos, VideoFacts)
    counts = sum((Counter(video.facts.counts) for video in listed), Counter[str]())
    parts = [
        VideoRows(video.name, video.address, video.facts.start, video.facts.rows)
        for video in listed
    ]
    html = render(
        "index.html", videos=listed, failed=_errors(videos), counts=counts, table=table_json(parts)
    )
    write_text(target, html)


def write_reviews(videos: Summaries, target: Path) -> None:
    """Write the list of reviews of many videos, from the `page` of each and its `ReviewFacts`."""
    listed = _listed(videos, ReviewFacts)
    write_text(target, render("reviews.html", videos=listed, failed=_errors(videos)))
