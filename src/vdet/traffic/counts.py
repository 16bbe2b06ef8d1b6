"""Events and what follows from them: totals, counts of each minute, stays in zones; as files too.

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
"""Of `.csv`: the fields of an event in their order."""
_FORMS = {"time": ".3f", "score": ".4f", "stitched": "d", "seconds": ".3f"}


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
        Of the line or zone.
    direction
        As the user named it; of a zone enter, exit, appear (it is first seen inside) or vanish (it
        is last seen inside).
    id
        Of the track.
    class_name
        Class of the vehicle; None if the detector has no classes.
    score
        0 to 1: that of the track in `frame`.
    stitched
        Whether the vehicle was followed as another track before, so that this one's id alone would
        not show it.
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
class Total:
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

    The times are None where no vehicle has left or vanished.
    """

    name: str
    most: int
    mean: float | None
    longest: float | None


@dataclass(frozen=True, slots=True)
class Counts:
    """All results of one video."""

    events: tuple[Event, ...]
    totals: tuple[Total, ...]
    minutes: tuple[MinuteCount, ...]
    zones: tuple[Stay, ...]

    @staticmethod
    def of(events: Sequence[Event], keys: Iterable[Key], zones: Iterable[str]) -> "Counts":
        """Sum up events; `keys` get a total even where nothing happened, `zones` are names."""
        nothing = (Total(*key, 0, {}) for key in keys)
        ones = (
            Total(each.name, each.direction, 1, {each.class_name: 1} if each.class_name else {})
            for each in events
        )
        totals = sum_totals([*nothing, *ones])
        return Counts(tuple(events), totals, _by_minute(events), _stays(events, zones))


def sum_totals(totals: Iterable[Total]) -> tuple[Total, ...]:
    """Return the sum of the totals of each name and direction, in the order of their first."""
    counts: Counter[Key] = Counter()
    classes: dict[Key, Counter[str]] = {}
    for each in totals:
        key = each.name, each.direction
        counts[key] += each.count
        classes[key] = classes.get(key, Counter()) + Counter(each.classes)
    return tuple(
        Total(*key, counts[key], dict(sorted(of_key.items()))) for key, of_key in classes.items()
    )


def _by_minute(events: Iterable[Event]) -> tuple[MinuteCount, ...]:
    """Return the counts of each minute; minutes without an event are left out."""
    counts = Counter((int(e.time // 60), e.name, e.direction) for e in events)
    return tuple(MinuteCount(*key, count) for key, count in sorted(counts.items()))


def _stays(events: Iterable[Event], zones: Iterable[str]) -> tuple[Stay, ...]:
    """Return the stays in each of the zones of these names."""
    ordered = sorted(events, key=lambda event: (event.time, event.direction in _IN))
    return tuple(_stay(name, [event for event in ordered if event.name == name]) for name in zones)


def _stay(name: str, events: Sequence[Event]) -> Stay:
    steps = [1 if event.direction in _IN else -1 for event in events]
    seconds = [event.seconds for event in events if event.seconds is not None]
    most = max(accumulate(steps), default=0)
    if not seconds:
        return Stay(name, most, None, None)
    return Stay(name, most, round(sum(seconds) / len(seconds), 3), max(seconds))


def write_counts(path: Path, counts: Counts) -> None:
    """Write the counts of one video."""
    if is_json(path):
        write_json(path, _plain(counts))
    else:
        write_table(path, _COLUMNS, map(_cells, counts.events))


def write_counts_of_all(path: Path, videos: Mapping[str, Counts]) -> None:
    """Write the counts of several videos, by their names."""
    if is_json(path):
        write_json(path, _joined({name: _plain(counts) for name, counts in videos.items()}))
    else:
        rows = ((name, *_cells(event)) for name, each in videos.items() for event in each.events)
        write_table(path, (VIDEO, *_COLUMNS), rows)


def join_counts(outputs: Mapping[str, Path], path: Path) -> None:
    """Write the counts of several videos into one file, from the file of each of the same form.

    Errors as of `join`.
    """
    join(outputs, path, _COLUMNS, _joined)


def _joined(videos: Mapping[str, Any]) -> dict[str, Any]:
    totals = sum_totals(Total(**total) for each in videos.values() for total in each["totals"])
    return {"totals": [asdict(each) for each in totals], "videos": videos}


def _plain(counts: Counts) -> dict[str, Any]:
    events = (dict(zip(_COLUMNS, astuple(event), strict=True)) for event in counts.events)
    return asdict(counts) | {"events": list(events)}


def _cells(event: Event) -> list[str]:
    return [
        "" if value is None else format(value, _FORMS.get(column, ""))
        for column, value in zip(_COLUMNS, astuple(event), strict=True)
    ]
