"""Events, and the totals, counts by minute and stays in zones that follow from them; their files.

A `.csv` has the events, a `.json` the events and all totals. A file over several videos has the
same columns with `video` before them, or the counts of each video and the sum of all totals.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any

from vdet.traffic.borders import APPEAR, ENTER
from vdet.traffic.tables import VIDEO, is_json, join, write_json, write_table

Key = tuple[str, str]
"""Name of a line or zone, and a direction."""

_IN = (ENTER, APPEAR)
_COLUMNS = ("time", "frame", "name", "direction", "id", "class", "score", "stitched", "seconds")
"""Columns of a `.csv`: the fields of an event in their order."""


@dataclass(frozen=True, slots=True)
class Event:
    """A vehicle crosses a line, or enters, leaves, appears in or vanishes from a zone.

    Attributes
    ----------
    time
        Seconds, as the frames of the video count them; interpolated between two frames.
    frame
        Number of the first frame at or after it, from 0.
    name
        Name of the line or zone.
    direction
        Direction of a line, as the user named it; for a zone enter, exit, appear (the vehicle is
        first seen inside) or vanish (it is last seen inside).
    id
        Id of the track.
    class_name
        Class of the vehicle; None if the detector has no classes.
    score
        Score of the track in `frame`, 0 to 1.
    stitched
        Whether the vehicle had another id before, without which this event would not be known.
    seconds
        How long the vehicle was in the zone, for exit and vanish; else None.
    """

    time: float
    frame: int
    name: str
    direction: str
    id: int
    class_name: str | None
    score: float
    stitched: bool
    seconds: float | None = None


@dataclass(frozen=True, slots=True)
class DirectionTotal:
    """How many vehicles were counted in a direction, and how many of them of each class."""

    name: str
    direction: str
    count: int
    classes: dict[str, int]


@dataclass(frozen=True, slots=True)
class MinuteCount:
    """How many vehicles were counted in a direction in one minute, from 0 at time 0."""

    minute: int
    name: str
    direction: str
    count: int


@dataclass(frozen=True, slots=True)
class Stay:
    """Vehicles in a zone: most at once, and how long they were there, seconds.

    `mean` and `longest` are None where no vehicle has left or vanished.
    """

    name: str
    most: int
    mean: float | None
    longest: float | None


@dataclass(frozen=True, slots=True)
class Counts:
    """All results of one video."""

    events: tuple[Event, ...]
    totals: tuple[DirectionTotal, ...]
    minutes: tuple[MinuteCount, ...]
    """Those with an event."""
    zones: tuple[Stay, ...]

    @staticmethod
    def of(events: Sequence[Event], keys: Iterable[Key], zones: Iterable[str]) -> "Counts":
        """Sum up events; `keys` get a total even where nothing happened, `zones` are names."""
        totals = [DirectionTotal(*key, 0, {}) for key in keys]
        for each in events:
            classes = {each.class_name: 1} if each.class_name else {}
            totals.append(DirectionTotal(each.name, each.direction, 1, classes))
        minutes = Counter((int(e.time // 60), e.name, e.direction) for e in events)
        return Counts(
            tuple(events),
            sum_totals(totals),
            tuple(MinuteCount(*key, count) for key, count in sorted(minutes.items())),
            tuple(_stay(name, [event for event in events if event.name == name]) for name in zones),
        )


def sum_totals(totals: Iterable[DirectionTotal]) -> tuple[DirectionTotal, ...]:
    """Return the sum of the totals of each name and direction, in the order of their first."""
    counts: Counter[Key] = Counter()
    classes: dict[Key, Counter[str]] = {}
    for each in totals:
        key = each.name, each.direction
        counts[key] += each.count
        classes[key] = classes.get(key, Counter()) + Counter(each.classes)
    return tuple(
        DirectionTotal(*key, count, dict(sorted(classes[key].items())))
        for key, count in counts.items()
    )


def _stay(name: str, events: Sequence[Event]) -> Stay:
    """Return the stays in the zone of these events; who leaves makes room for who enters then."""
    ordered = sorted(events, key=lambda event: (event.time, event.direction in _IN))
    most = max(accumulate(1 if each.direction in _IN else -1 for each in ordered), default=0)
    seconds = [event.seconds for event in events if event.seconds is not None]
    mean = round(sum(seconds) / len(seconds), 3) if seconds else None
    return Stay(name, most, mean, max(seconds, default=None))


def write_counts(path: Path, counts: Counts | Mapping[str, Counts]) -> None:
    """Write the counts of one video, or of several by their names."""
    if isinstance(counts, Counts):
        value: Any = _plain(counts)
        columns: tuple[str, ...] = _COLUMNS
        rows = list(map(_cells, counts.events))
    else:
        value = _joined({name: _plain(each) for name, each in counts.items()})
        columns = (VIDEO, *_COLUMNS)
        rows = [[name, *_cells(event)] for name, each in counts.items() for event in each.events]
    if is_json(path):
        write_json(path, value)
    else:
        write_table(path, columns, rows)


def join_counts(outputs: Mapping[str, Path], path: Path) -> None:
    """Write the counts of several videos into one file, from the file of each of the same form.

    Errors as of `join`.
    """
    join(outputs, path, _COLUMNS, _joined)


def _joined(videos: Mapping[str, Any]) -> dict[str, Any]:
    totals = [DirectionTotal(**total) for each in videos.values() for total in each["totals"]]
    return {"totals": [asdict(each) for each in sum_totals(totals)], "videos": videos}


def _plain(counts: Counts) -> dict[str, Any]:
    events = (dict(zip(_COLUMNS, astuple(event), strict=True)) for event in counts.events)
    return asdict(counts) | {"events": list(events)}


def _cells(event: Event) -> list[Any]:
    return [int(value) if isinstance(value, bool) else value for value in astuple(event)]
