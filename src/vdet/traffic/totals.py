"""Events, and what follows from them: totals, counts of each minute, and stays in zones."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate

from vdet.traffic.layout import APPEAR, ENTER

Key = tuple[str, str]
"""Name of a line or zone, and a direction."""

_IN = (ENTER, APPEAR)


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
        Class of the vehicle; None where the detector does not tell classes.
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
    """The same in one minute; minute 0 is the first of the video."""

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
    def of(
        events: Sequence[Event], keys: Iterable[Key] = (), zones: Iterable[str] = ()
    ) -> "Counts":
        """Sum up events; `keys` are counted also where nothing happened, `zones` are names."""
        return Counts(tuple(events), totals(events, keys), by_minute(events), stays(events, zones))


def totals(events: Iterable[Event], keys: Iterable[Key] = ()) -> tuple[Total, ...]:
    """Return the total of each name and direction: first `keys`, then others as they occur."""
    classes: dict[Key, Counter[str]] = {key: Counter() for key in keys}
    counts: Counter[Key] = Counter()
    for event in events:
        key = event.name, event.direction
        counts[key] += 1
        of_key = classes.setdefault(key, Counter())
        if event.class_name is not None:
            of_key[event.class_name] += 1
    return tuple(
        Total(*key, counts[key], dict(sorted(of_key.items()))) for key, of_key in classes.items()
    )


def by_minute(events: Iterable[Event]) -> tuple[MinuteCount, ...]:
    """Return the counts of each minute; minutes without an event are left out."""
    counts = Counter((int(e.time // 60), e.name, e.direction) for e in events)
    return tuple(MinuteCount(*key, count) for key, count in sorted(counts.items()))


def stays(events: Iterable[Event], zones: Iterable[str]) -> tuple[Stay, ...]:
    """Return what the events say of the vehicles in each of the zones of these names."""
    ordered = sorted(events, key=lambda event: (event.time, event.direction in _IN))
    return tuple(_stay(name, [event for event in ordered if event.name == name]) for name in zones)


def _stay(name: str, events: Sequence[Event]) -> Stay:
    steps = [1 if event.direction in _IN else -1 for event in events]
    seconds = [event.seconds for event in events if event.seconds is not None]
    most = max(accumulate(steps), default=0)
    if not seconds:
        return Stay(name, most, None, None)
    return Stay(name, most, round(sum(seconds) / len(seconds), 3), max(seconds))
