"""The table of vehicles of a page, which `vehicles.js` filters and sorts in the browser."""

import json
from collections.abc import Hashable, Iterable, Sequence
from datetime import datetime

from pydantic import BaseModel, ConfigDict

from vdet.detect.classes import UNKNOWN


class VehicleRow(BaseModel):
    """A vehicle in the table of a video or of a batch.

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
    distance, lane
        As records have them; None where they are not known.
    picture
        Address of its picture as seen from the page of its video; empty where there is none.
    """

    model_config = ConfigDict(frozen=True)

    id: int
    class_name: str | None
    first: float
    moment: str
    seconds: float
    clock: str | None = None
    speed: float | None = None
    way: str = ""
    motion: str = ""
    distance: float | None = None
    lane: int | None = None
    picture: str = ""


Part = tuple[str, str | None, str, Sequence[VehicleRow]]
"""The vehicles of a video: its name, the address of its page (empty for this page, None where it
has no player), what comes before the addresses of pictures, and the rows."""


def table_json(parts: Sequence[Part]) -> str:
    """Return the columns of the table, as `vehicles.js` reads them; texts are numbers of lists."""
    rows = [(number, row) for number, (*_, some) in enumerate(parts) for row in some]
    before = [folder for _, _, folder, _ in parts]
    classes, kinds = _numbered(row.class_name or UNKNOWN for _, row in rows)
    ways, ways_of = _numbered(row.way for _, row in rows)
    states, states_of = _numbered(row.motion for _, row in rows)
    columns = {
        name: [getattr(row, name) for _, row in rows]
        for name in ("id", "first", "moment", "seconds", "speed", "distance", "lane")
    }
    table = {
        "videos": [{"name": name, "page": page} for name, page, *_ in parts],
        "classes": classes,
        "ways": ways,
        "states": states,
        "video": [number for number, _ in rows],
        "class": kinds,
        "way": ways_of,
        "state": states_of,
        **columns,
        "clock": [_plain_seconds(row.clock) for _, row in rows],
        "picture": [row.picture and before[number] + row.picture for number, row in rows],
    }
    text = json.dumps(table, separators=(",", ":"), ensure_ascii=False)
    return text.replace("<", "\\u003c")  # nothing in it ends the element that holds it


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
