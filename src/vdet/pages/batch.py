"""The page over the videos of a batch: totals, a link to each page, and a table of all vehicles."""

import json
from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from vdet.detect.classes import UNKNOWN
from vdet.files import write_text
from vdet.pages.render import link_to, render

NO_STILL = "data:image/jpeg;base64,"
"""The still of a video without a frame."""


class VehicleRow(BaseModel):
    """A vehicle in the table of a batch.

    Attributes
    ----------
    first
        When it is first shown, seconds in the video.
    moment
        Where the player of the page of its video stands then, seconds.
    seconds
        How long it is shown.
    clock
        `first` in ISO 8601; None where the clock is not known.
    speed
        Its median, km/h; None where it is not known.
    way
        The lines and zones where it was counted, in order.
    motion
        Whether it drove or stood, as records say it; empty where that is not known.
    picture
        Address of its picture as seen from the page of its video; empty where there is none.
    """

    model_config = ConfigDict(frozen=True)

    class_name: str | None
    first: float
    moment: str
    seconds: float
    clock: str | None = None
    speed: float | None = None
    way: str = ""
    motion: str = ""
    picture: str = ""


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
    rows: tuple[VehicleRow, ...] = ()


def write_index(videos: Sequence[tuple[str, Path, VideoFacts]], target: Path) -> None:
    """Write the page over many videos: each has a name, a page as seen from it, and facts."""
    counts: Counter[str] = Counter()
    for _, _, facts in videos:
        counts.update(facts.counts)
    linked = [(name, link_to(page, Path()), facts) for name, page, facts in videos]
    table = json.dumps(_table(videos), separators=(",", ":"), ensure_ascii=False)
    table = table.replace("<", "\\u003c")  # nothing in it ends the element that holds it
    write_text(target, render("index.html", videos=linked, counts=counts, table=table))


def _table(videos: Sequence[tuple[str, Path, VideoFacts]]) -> dict[str, Any]:
    """Return the columns of the table, as `index.js` reads them; texts are numbers of lists."""
    rows = [(number, row) for number, (_, _, facts) in enumerate(videos) for row in facts.rows]
    folders = [link_to(page.parent, Path()) for _, page, _ in videos]
    classes, kinds = _numbered(row.class_name or UNKNOWN for _, row in rows)
    ways, ways_of = _numbered(row.way for _, row in rows)
    states, states_of = _numbered(row.motion for _, row in rows)
    return {
        "videos": [{"name": name, "page": link_to(page, Path())} for name, page, _ in videos],
        "classes": classes,
        "ways": ways,
        "states": states,
        "video": [number for number, _ in rows],
        "class": kinds,
        "way": ways_of,
        "state": states_of,
        "first": [row.first for _, row in rows],
        "moment": [row.moment for _, row in rows],
        "seconds": [row.seconds for _, row in rows],
        "clock": [_plain_seconds(row.clock) for _, row in rows],
        "speed": [row.speed for _, row in rows],
        "picture": [row.picture and f"{folders[number]}/{row.picture}" for number, row in rows],
    }


def _numbered(values: Iterable[str]) -> tuple[list[str], list[int]]:
    """Return the different values, the empty one first, and the number of each value."""
    numbers: dict[Hashable, int] = {"": 0}
    found = [numbers.setdefault(value, len(numbers)) for value in values]
    return [str(value) for value in numbers], found


def _plain_seconds(clock: str | None) -> int | None:
    """Return the seconds of a moment since 1970, as if the clock of the camera had no zone."""
    if clock is None:
        return None
    plain = datetime.fromisoformat(clock).replace(tzinfo=None)
    return round((plain - datetime(1970, 1, 1)).total_seconds())
