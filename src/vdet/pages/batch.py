"""The pages over the videos of a batch, and the table of vehicles on all pages.

`vehicles.js` filters and sorts the table in the browser.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from vdet.config.classes import UNKNOWN
from vdet.files import write_text
from vdet.pages.render import PAGE_NAME, link_to, render

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
class VideoRows:
    """The vehicles of a video.

    Attributes
    ----------
    name
        Name of the video.
    page
        Address of its page; empty for this page.
    plays
        Whether the page has a player.
    start
        Time in the video at which the player begins, seconds.
    """

    name: str
    page: str
    plays: bool
    start: float
    rows: Sequence[Row]

    def addresses(self, column: str) -> list[str]:
        """Return the addresses in a column of the rows, relative to the page of the table."""
        folder = self.page.removesuffix(PAGE_NAME)
        return [row[column] and folder + row[column] for row in self.rows]


def table_json(parts: Sequence[VideoRows]) -> str:
    """Return the columns of the table for `vehicles.js`.

    Empty columns are omitted. `counts` has the number of rows of each video.
    """
    rows = [row for part in parts for row in part.rows]
    columns: dict[str, list[Any]] = {
        "class": [row["class_name"] or UNKNOWN for row in rows],
        **{name: [row[name] for row in rows] for name in _COLUMNS},
        "clock": [_plain_seconds(row["clock"]) for row in rows],
        "picture": [address for part in parts for address in part.addresses("picture")],
        "clip": [address for part in parts for address in part.addresses("clip")],
    }
    table = {
        "names": [part.name for part in parts],
        "pages": [part.page for part in parts],
        "plays": [part.plays for part in parts],
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
class _Listed:
    """A video in a list, with the address of its page."""

    name: str
    address: str
    facts: Mapping[str, Any]

    @property
    def folder(self) -> str:
        """Prefix of addresses that are relative to the page."""
        return self.address.removesuffix(PAGE_NAME)


def _listed(videos: Summaries) -> list[_Listed]:
    """Return the videos that did not fail."""
    return [
        _Listed(name, link_to(Path(name).parent / values["page"], Path()), values)
        for name, values in videos.items()
        if "error" not in values
    ]


def _errors(videos: Summaries) -> dict[str, str]:
    return {name: values["error"] for name, values in videos.items() if "error" in values}


def write_index(videos: Summaries, target: Path) -> None:
    """Write the page over many videos, from the summaries of their pages.

    A video that failed has its `error` instead.
    """
    listed = _listed(videos)
    counts = sum((Counter(video.facts["counts"]) for video in listed), Counter[str]())
    parts = [
        VideoRows(
            video.name, video.address, *(video.facts[key] for key in ("plays", "start", "rows"))
        )
        for video in listed
    ]
    html = render(
        "index.html", videos=listed, failed=_errors(videos), counts=counts, table=table_json(parts)
    )
    write_text(target, html)


def write_reviews(videos: Summaries, target: Path) -> None:
    """Write the list of reviews of many videos, from the summaries of these."""
    listed = _listed(videos)
    write_text(target, render("reviews.html", videos=listed, failed=_errors(videos)))
