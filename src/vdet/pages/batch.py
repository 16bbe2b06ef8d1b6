"""The page over the videos of a batch, and the table of vehicles on all pages.

`vehicles.js` filters and sorts the table in the browser.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from vdet.config.classes import UNKNOWN
from vdet.files import write_text
from vdet.pages.render import PAGE_NAME, link_to, render

NO_STILL = "data:image/jpeg;base64,"
"""Thumbnail of a video without a frame."""
_COLUMNS = ("id", "first", "seconds", "speed", "lines", "motion", "distance", "lane")
_UNKNOWN = (None, "")  # empty values


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
    picture
        Address of its image relative to the page of its video; empty if there is none.
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
    picture: str = ""


class VideoFacts(BaseModel):
    """Key figures of a video, for the page over many videos.

    `seconds` is the duration of the processed part, `max_at_once` the maximum number of vehicles
    at a time. `counts` are by name, `conditions` are reasons to doubt them; `still` is a thumbnail
    as a data URI. The player of its page begins at `start`, seconds in the video.
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


@dataclass(frozen=True, slots=True)
class Part:
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

    @property
    def folder(self) -> str:
        """Prefix of the addresses of images."""
        return (self.page or "").removesuffix(PAGE_NAME)


def table_json(parts: Sequence[Part]) -> str:
    """Return the columns of the table for `vehicles.js`.

    Empty columns are omitted. `counts` has the number of rows of each video.
    """
    rows = [row for part in parts for row in part.rows]
    columns: dict[str, list[Any]] = {
        "class": [row.class_name or UNKNOWN for row in rows],
        **{name: [getattr(row, name) for row in rows] for name in _COLUMNS},
        "clock": [_plain_seconds(row.clock) for row in rows],
        "picture": [
            row.picture and part.folder + row.picture for part in parts for row in part.rows
        ],
    }
    table = {
        "names": [part.name for part in parts],
        "pages": [part.page for part in parts],
        "starts": [part.start for part in parts],
        "counts": [len(part.rows) for part in parts],
        **{name: values for name, values in columns.items() if _is_known(values)},
    }
    text = json.dumps(table, separators=(",", ":"), ensure_ascii=False)
    return text.replace("<", "\\u003c")  # so that nothing in it ends the enclosing element


def _is_known(values: Sequence[Any]) -> bool:
    """Return whether a column has a value; without rows, all columns are kept."""
    return not values or any(value not in _UNKNOWN for value in values)


def _plain_seconds(clock: str | None) -> int | None:
    """Return a clock time as seconds since 1970, ignoring its zone."""
    if clock is None:
        return None
    return round(datetime.fromisoformat(clock).replace(tzinfo=UTC).timestamp())


def write_index(videos: Mapping[str, Mapping[str, Any]], target: Path) -> None:
    """Write the page over many videos, from the folder of each page and its `VideoFacts`.

    A video that failed has its `error` instead.
    """
    failed, linked = {}, []
    for name, values in videos.items():
        if "error" in values:
            failed[name] = values["error"]
            continue
        page = Path(name).parent / values["folder"] / PAGE_NAME
        linked.append((name, link_to(page, Path()), VideoFacts(**values)))
    counts = sum((Counter(facts.counts) for _, _, facts in linked), Counter[str]())
    parts = [Part(name, page, facts.start, facts.rows) for name, page, facts in linked]
    html = render(
        "index.html", videos=linked, failed=failed, counts=counts, table=table_json(parts)
    )
    write_text(target, html)
