"""The page over the videos of a batch, and the table of vehicles of all pages.

The table is filtered and sorted in the browser, by `vehicles.js`.
"""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from vdet.detect.classes import UNKNOWN
from vdet.files import write_text
from vdet.pages.render import PAGE_NAME, link_to, render

NO_STILL = "data:image/jpeg;base64,"
"""The still of a video without a frame."""
_NUMBERS = ("id", "first", "seconds", "speed", "distance", "lane")
_UNKNOWN = (None, "")  # values that say nothing


class VehicleRow(BaseModel):
    """A vehicle in the table of a video or of a batch.

    Attributes
    ----------
    first
        When it is first shown, seconds in the video.
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
    distance, lane
        As records have them; None where they are not known.
    picture
        Address of its picture as seen from the page of its video; empty where there is none.
    """

    model_config = ConfigDict(frozen=True)

    id: int
    class_name: str | None
    first: float
    seconds: float
    clock: str | None = None
    speed: float | None = None
    way: str = ""
    motion: str = ""
    distance: float | None = None
    lane: int | None = None
    picture: str = ""


class VideoFacts(BaseModel):
    """A video in numbers: pages over many videos are made from it.

    `seconds` is how much of the video was searched, `most` how many vehicles were shown at once.
    `counts` are by name, `conditions` say what makes them doubtful; `still` is a small picture as a
    data URI. The player of its page begins at `start`, seconds in the video.
    """

    model_config = ConfigDict(frozen=True)

    start: float = 0.0
    seconds: float = Field(ge=0)
    frames: int = Field(ge=0)
    vehicles: int = Field(ge=0)
    most: int = Field(ge=0)
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
        That of the video.
    page
        Address of its page: empty for this page, None where it has no player.
    start
        Time in the video at which the player begins, seconds.
    folder
        What comes before the addresses of pictures.
    """

    name: str
    page: str | None
    start: float
    folder: str
    rows: Sequence[VehicleRow]


def table_json(parts: Sequence[Part]) -> str:
    """Return the columns of the table, as `vehicles.js` reads them.

    Columns in which nothing is known are left out, and `texts` has the values of columns that are
    numbers of texts: a browser reads 100,000 rows twice as fast. `counts` has the number of rows of
    each video, and clocks count from `zero`.
    """
    rows = [row for part in parts for row in part.rows]
    clocks = [_plain_seconds(row.clock) for row in rows]
    zero = min((clock for clock in clocks if clock is not None), default=0)
    texts = {
        "class": [row.class_name or UNKNOWN for row in rows],
        "way": [row.way for row in rows],
        "state": [row.motion for row in rows],
    }
    columns: dict[str, list[Any]] = {
        **{name: _numbered(values) for name, values in texts.items() if _is_known(values)},
        **{name: [getattr(row, name) for row in rows] for name in _NUMBERS},
        "clock": [clock if clock is None else clock - zero for clock in clocks],
        "picture": [
            row.picture and part.folder + row.picture for part in parts for row in part.rows
        ],
    }
    table = {
        "names": [part.name for part in parts],
        "pages": [part.page for part in parts],
        "starts": [part.start for part in parts],
        "counts": [len(part.rows) for part in parts],
        "zero": zero,
        "texts": {name: list(dict.fromkeys(values)) for name, values in texts.items()},
        **{name: values for name, values in columns.items() if _is_known(values)},
    }
    text = json.dumps(table, separators=(",", ":"), ensure_ascii=False)
    return text.replace("<", "\\u003c")  # nothing in it ends the element that holds it


def _is_known(values: Sequence[Any]) -> bool:
    """Return whether a column says something; where there is no row, all columns are kept."""
    return not values or any(value not in _UNKNOWN for value in values)


def _numbered(values: Sequence[str]) -> list[int]:
    """Return the number of each value among the different ones."""
    numbers = {value: number for number, value in enumerate(dict.fromkeys(values))}
    return [numbers[value] for value in values]


def _plain_seconds(clock: str | None) -> int | None:
    """Return the seconds of a moment since 1970, as if the clock of the camera had no zone."""
    if clock is None:
        return None
    plain = datetime.fromisoformat(clock).replace(tzinfo=None)
    return round((plain - datetime(1970, 1, 1)).total_seconds())


def write_index(videos: Sequence[tuple[str, Path, VideoFacts]], target: Path) -> None:
    """Write the page over many videos: each has a name, a page as seen from it, and facts."""
    counts = sum((Counter(facts.counts) for _, _, facts in videos), Counter[str]())
    linked = [(name, link_to(page, Path()), facts) for name, page, facts in videos]
    parts = [
        Part(name, page, facts.start, page.removesuffix(PAGE_NAME), facts.rows)
        for name, page, facts in linked
    ]
    page = render("index.html", videos=linked, counts=counts, table=table_json(parts))
    write_text(target, page)
