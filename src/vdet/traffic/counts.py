"""Events, and what follows from them: totals, flows, and the use of zones, by interval and class.

Tables cover the whole video, or intervals of it. With a clock, intervals begin at round times of
the day. Several videos have one table, with a clock in each.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from itertools import accumulate, groupby, pairwise
from typing import TypeVar

from vdet.errors import ConfigError
from vdet.labels.formats import UNKNOWN
from vdet.traffic.borders import APPEAR, ENTER, EXIT, VANISH
from vdet.traffic.clock import Clock

Way = tuple[str, str]
"""Name of a line or zone, and a direction."""

Moment = datetime | float | None
"""The moment on the clock; seconds in a video without; None in several without."""

_IN, _OUT = (ENTER, APPEAR), (EXIT, VANISH)

R = TypeVar("R")


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
    vehicle
        Number of the vehicle. Several tracks have one where they were taken for one vehicle.
    class_name
        Class of the vehicle; None if the detector has no classes.
    score
        Score of the track in `frame`, 0 to 1.
    seconds
        How long the vehicle was in the zone, for exit and vanish; else None.
    speed, speed_sd
        Speed at `time`, and its standard deviation, km/h; None where it is not known.
    mean_speed
        Mean speed since the event before of the same track, from the places at both events alone,
        km/h; None where it is not known.
    """

    time: float
    frame: int
    name: str
    direction: str
    id: int
    vehicle: int
    class_name: str | None
    score: float
    seconds: float | None = None
    speed: float | None = None
    speed_sd: float | None = None
    mean_speed: float | None = None


@dataclass(frozen=True, slots=True)
class DirectionTotal:
    """How many vehicles were counted in a direction, and how many of them of each class."""

    name: str
    direction: str
    count: int
    classes: dict[str, int]


@dataclass(frozen=True, slots=True)
class CountRow:
    """Vehicles of a class that were counted in a direction of a line or zone, in an interval.

    The class is `UNKNOWN` where the detector has no classes, as in `FlowRow`.
    """

    start: Moment
    end: Moment
    name: str
    direction: str
    class_name: str
    count: int


@dataclass(frozen=True, slots=True)
class FlowRow:
    """Vehicles of a class from one line or zone to another, in the interval of the first.

    `destination` is None for vehicles that were at no other.
    """

    start: Moment
    end: Moment
    origin: str
    destination: str | None
    class_name: str
    count: int


@dataclass(frozen=True, slots=True)
class ZoneRow:
    """The use of a zone in an interval.

    Attributes
    ----------
    entered, left
        Vehicles that came in or appeared, and that left or vanished.
    mean, most
        Vehicles inside: the mean over the time of video in the interval, and the most at once.
    mean_stay, longest_stay
        Of the vehicles that left or vanished, seconds; None where none did.
    """

    start: Moment
    end: Moment
    name: str
    entered: int
    left: int
    mean: float
    most: int
    mean_stay: float | None
    longest_stay: float | None


@dataclass(frozen=True, slots=True)
class Counts:
    """All results of one video.

    Attributes
    ----------
    ways
        Each direction of each line and zone.
    zones
        The names of the zones.
    first, last
        Times of the first and the last frame, seconds.
    clock
        None where it is not known.
    warnings
        A sentence for each line that is not where it should be.
    """

    events: tuple[Event, ...]
    ways: tuple[Way, ...]
    zones: tuple[str, ...]
    first: float = 0.0
    last: float = 0.0
    clock: Clock | None = None
    warnings: tuple[str, ...] = ()

    @property
    def totals(self) -> tuple[DirectionTotal, ...]:
        """The totals over the whole video, also of directions without a vehicle."""
        return direction_totals([self])

    def table(self, interval: int | None = None) -> list[CountRow]:
        """Return the counts by interval (seconds), as `count_table` does."""
        return count_table([self], interval)

    def flows(self, interval: int | None = None) -> list[FlowRow]:
        """Return the flows by interval (seconds), as `flow_table` does."""
        return flow_table([self], interval)

    def zone_use(self, interval: int | None = None) -> list[ZoneRow]:
        """Return the use of zones by interval (seconds), as `zone_table` does."""
        return zone_table([self], interval)


def direction_totals(videos: Sequence[Counts]) -> tuple[DirectionTotal, ...]:
    """Return the totals of each direction over the whole of all videos."""
    classes: dict[Way, Counter[str]] = {way: Counter() for each in videos for way in each.ways}
    for event in (event for each in videos for event in each.events):
        classes[event.name, event.direction][event.class_name or ""] += 1
    return tuple(
        DirectionTotal(*way, found.total(), {name: found[name] for name in sorted(found) if name})
        for way, found in classes.items()
    )


def count_table(videos: Sequence[Counts], interval: int | None = None) -> list[CountRow]:
    """Return how many vehicles were counted in each interval, by direction and class.

    Parameters
    ----------
    interval
        Seconds; None for one interval over all.

    Raises
    ------
    ConfigError
        There are intervals, and several videos of which one has no clock.
    """
    axis = _Axis(videos, interval)
    timed = [
        (axis.number(which, each.time), (each.name, each.direction), each.class_name)
        for which, video in enumerate(videos)
        for each in video.events
    ]
    return _rows(CountRow, axis, timed, dict.fromkeys(way for each in videos for way in each.ways))


def flow_table(videos: Sequence[Counts], interval: int | None = None) -> list[FlowRow]:
    """Return the flows in each interval, by class: the ways of vehicles through lines and zones.

    A flow leads from the first line or zone of a vehicle to the last, which is the same one where
    it comes back. It counts in the interval of the first. Parameters and errors as of
    `count_table`.
    """
    axis = _Axis(videos, interval)
    visits: dict[int, list[tuple[int, Event]]] = {}
    for which, video in enumerate(videos):
        for trip in vehicle_trips(video):
            visits.setdefault(trip[0].vehicle, []).extend((which, each) for each in trip)
    timed = []
    for (which, first), *others in visits.values():
        last = others[-1][-1].name if others else None
        timed.append((axis.number(which, first.time), (first.name, last), first.class_name))
    names = dict.fromkeys(name for each in videos for name, _ in each.ways)
    order = {name: number for number, name in enumerate((*names, None))}
    flows = sorted({way for _, way, _ in timed}, key=lambda way: [order[name] for name in way])
    return _rows(FlowRow, axis, timed, flows)


def vehicle_trips(video: Counts) -> list[list[Event]]:
    """Return the crossings of lines and the entries into zones of each vehicle, in order."""
    trips: dict[int, list[Event]] = {}
    for each in video.events:
        if each.name not in video.zones or each.direction in _IN:
            trips.setdefault(each.vehicle, []).append(each)
    return list(trips.values())


def zone_table(videos: Sequence[Counts], interval: int | None = None) -> list[ZoneRow]:
    """Return the use of each zone in each interval; parameters and errors as of `count_table`."""
    axis = _Axis(videos, interval)
    rows = []
    for name in dict.fromkeys(name for each in videos for name in each.zones):
        # Who leaves makes room for who enters then.
        events = sorted(
            (
                (axis.seconds(which, each.time), each.direction in _IN, each.seconds)
                for which, video in enumerate(videos)
                for each in video.events
                if each.name == name
            ),
            key=lambda event: event[:2],
        )
        by_number = {
            number: list(some) for number, some in groupby(events, lambda e: axis.number_at(e[0]))
        }
        inside = 0
        for number in axis.numbers:
            here = by_number.get(number, [])
            rows.append(_zone_row(name, axis, number, here, inside))
            inside += sum(1 if enters else -1 for _, enters, _ in here)
    return rows


def _zone_row(
    name: str,
    axis: "_Axis",
    number: int,
    events: Sequence[tuple[float, bool, float | None]],
    inside: int,
) -> ZoneRow:
    """Return the use in one interval, at whose start so many vehicles are inside."""
    begin, end = axis.limits(number)
    changes = [1 if enters else -1 for _, enters, _ in events]
    levels = list(accumulate(changes, initial=inside))
    times = [begin, *(time for time, _, _ in events), end]
    used = sum(n * (b - a) for n, (a, b) in zip(levels, pairwise(times), strict=True))
    stays = [stay for _, _, stay in events if stay is not None]
    return ZoneRow(
        *axis.moments(number),
        name,
        changes.count(1),
        changes.count(-1),
        round(used / axis.covered(number), 3) if end > begin else float(inside),
        max(levels),
        round(sum(stays) / len(stays), 3) if stays else None,
        max(stays, default=None),
    )


class _Axis:
    """The intervals of one or several videos, by their numbers.

    Its seconds are those of the video, of the clock's local time since 1970, or of several videos
    without clocks one after the other.
    """

    def __init__(self, videos: Sequence[Counts], interval: int | None) -> None:
        self._interval = interval
        self._origin: datetime | None = None
        self._is_timed = True
        self._zeros = [0.0]
        clocks = [each.clock for each in videos if each.clock]
        if clocks and len(clocks) == len(videos):
            offset = clocks[0].zero.utcoffset() or timedelta()
            self._origin = datetime(1970, 1, 1, tzinfo=timezone(offset))
            self._zeros = [(clock.zero - self._origin).total_seconds() for clock in clocks]
        elif len(videos) > 1:
            if interval is not None:
                raise ConfigError(
                    "intervals over several videos need the time at which each begins; give --begin"
                )
            self._is_timed = False
            ends = accumulate(each.last - each.first for each in videos)
            self._zeros = [end - each.last for end, each in zip(ends, videos, strict=True)]
        self._spans = [(z + v.first, z + v.last) for z, v in zip(self._zeros, videos, strict=True)]
        self._first = min(first for first, _ in self._spans)
        self._last = max(last for _, last in self._spans)
        ranges = (map(self.number_at, span) for span in self._spans)
        self.numbers = sorted({n for first, last in ranges for n in range(first, last + 1)})

    def seconds(self, which: int, time: float) -> float:
        """Return a time in one of the videos in seconds of the axis."""
        return self._zeros[which] + time

    def number(self, which: int, time: float) -> int:
        """Return the number of the interval of a time in one of the videos."""
        return self.number_at(self.seconds(which, time))

    def number_at(self, seconds: float) -> int:
        """Return the number of an interval."""
        within = min(max(seconds, self._first), self._last)  # events are interpolated
        return 0 if self._interval is None else int(within // self._interval)

    def limits(self, number: int) -> tuple[float, float]:
        """Return the part of an interval between the first and the last frame of all videos."""
        if self._interval is None:
            return self._first, self._last
        begin = number * self._interval
        return max(begin, self._first), min(begin + self._interval, self._last)

    def covered(self, number: int) -> float:
        """Return the seconds of video in an interval."""
        begin, end = self.limits(number)
        return sum(max(0.0, min(end, last) - max(begin, first)) for first, last in self._spans)

    def moments(self, number: int) -> tuple[Moment, Moment]:
        """Return the start and the end of an interval."""
        start, end = self._first, self._last
        if self._interval is not None:
            start, end = (float(each * self._interval) for each in (number, number + 1))
        return self._moment(start), self._moment(end)

    def _moment(self, seconds: float) -> Moment:
        if self._origin:
            return self._origin + timedelta(milliseconds=round(1000 * seconds))
        return round(seconds, 3) if self._is_timed else None


def _rows(
    make: Callable[..., R],
    axis: _Axis,
    timed: Sequence[tuple[int, tuple[str, str | None], str | None]],
    ways: Iterable[tuple[str, str | None]],
) -> list[R]:
    """Return a row for each interval, way and class that occurs, also where its count is 0."""
    found = Counter((number, way, name or UNKNOWN) for number, way, name in timed)
    classes = sorted({name for _, _, name in found}) or [UNKNOWN]
    keys = [(way, name) for way in ways for name in classes]
    return [
        make(*axis.moments(number), *way, name, found[number, way, name])
        for number in axis.numbers
        for way, name in keys
    ]
