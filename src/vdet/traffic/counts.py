"""Events, and the tables computed from them: totals, flows and zones, by interval and class.

Tables cover the whole video or intervals of it. Several videos have one table.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, TypeVar

from vdet.detect.classes import UNKNOWN
from vdet.errors import needing
from vdet.traffic.clock import Clock, Intervals, Moment, Span
from vdet.traffic.crossings import APPEAR, ENTER

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Direction = tuple[str, str]
"""Name of a line or zone, and of a direction."""

_IN = ENTER, APPEAR

R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Event:
    """A vehicle crosses a line, or enters, leaves, appears in or vanishes from a zone.

    Attributes
    ----------
    time
        Seconds in the video, interpolated between two frames.
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
        Number of the vehicle, which several linked tracks share.
    class_name
        Class of the vehicle; None if the detector has no classes.
    score
        Score of the track in `frame`, 0 to 1.
    seconds
        How long the vehicle was in the zone, for exit and vanish; else None.
    speed, speed_sd
        Speed at `time`, and its standard deviation, km/h; None if unknown.
    mean_speed
        Mean speed since the previous event of the same track, from the positions at both events,
        km/h; None if unknown.
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
    """Number of vehicles counted in a direction, in total and by class."""

    name: str
    direction: str
    count: int
    classes: dict[str, int]


@dataclass(frozen=True, slots=True)
class CountRow:
    """Number of vehicles of a class in a direction of a line or zone, in an interval.

    The class is `UNKNOWN` if the detector has no classes, as in `FlowRow`.
    """

    start: Moment
    end: Moment
    name: str
    direction: str
    class_name: str
    count: int


@dataclass(frozen=True, slots=True)
class FlowRow:
    """Number of vehicles of a class from one line or zone to another, in an interval.

    The interval is that of the first event. `destination` is None for vehicles with one event only.
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
        Vehicles that entered or appeared, and that left or vanished.
    mean, max
        Mean and maximum number of vehicles inside, over the video in the interval.
    mean_stay, max_stay
        Of the vehicles that left or vanished, seconds; None if none did.
    """

    start: Moment
    end: Moment
    name: str
    entered: int
    left: int
    mean: float
    max: int
    mean_stay: float | None
    max_stay: float | None


@dataclass(frozen=True, slots=True)
class Counts:
    """All results of one video.

    Attributes
    ----------
    directions
        Each direction of each line and zone.
    zones
        The names of the zones.
    spans
        The parts with video, seconds.
    clock
        None if unknown.
    warnings
        A sentence for each misplaced line.
    """

    events: tuple[Event, ...]
    directions: tuple[Direction, ...]
    zones: tuple[str, ...]
    spans: tuple[Span, ...] = ((0.0, 0.0),)
    clock: Clock | None = None
    warnings: tuple[str, ...] = ()

    @property
    def totals(self) -> tuple[DirectionTotal, ...]:
        """The totals over the whole video, including directions without vehicles."""
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

    def to_pandas(self, interval: int | None = None) -> "pd.DataFrame":
        """Return `table` with a column for each field; needs the package pandas."""
        with needing("notebook"):
            import pandas as pd

        names = [field.name for field in fields(CountRow)]
        return pd.DataFrame(self.table(interval), columns=names)

    def plot(self, interval: int | None = None, axes: "Axes | None" = None) -> "Axes":
        """Draw the counts as bars; needs the package matplotlib.

        There is a bar for each direction, stacked by class; or, with an interval in seconds, a bar
        for each interval, stacked by direction.

        Parameters
        ----------
        axes
            The axes to draw on; None for the current axes of pyplot.

        Raises
        ------
        PackageError
            matplotlib is not installed.
        """
        with needing("notebook"):
            from matplotlib import pyplot as plt
        parts: dict[str, Counter[str]] = {}
        for row in self.table(interval):
            label = f"{row.name} {row.direction}"
            part, bar = (label, str(row.start)[:16]) if interval else (row.class_name, label)
            parts.setdefault(part, Counter())[bar] += row.count
        axes = axes or plt.gca()
        heights = Counter[str]()
        for part, found in parts.items():
            bottom = [heights[bar] for bar in found]
            axes.bar(list(found), list(found.values()), bottom=bottom, label=part)
            heights.update(found)
        axes.set_ylabel("vehicles")
        axes.yaxis.get_major_locator().set_params(integer=True)
        axes.legend()
        return axes


def direction_totals(videos: Sequence[Counts]) -> tuple[DirectionTotal, ...]:
    """Return the totals of each direction over all videos."""
    classes = {key: Counter[str]() for video in videos for key in video.directions}
    for event in (event for video in videos for event in video.events):
        classes[event.name, event.direction][event.class_name or ""] += 1
    return tuple(
        DirectionTotal(*key, found.total(), {name: found[name] for name in sorted(found) if name})
        for key, found in classes.items()
    )


def count_table(videos: Sequence[Counts], interval: int | None = None) -> list[CountRow]:
    """Return how many vehicles were counted in each interval, by direction and class.

    Parameters
    ----------
    interval
        Seconds; None for a single interval.

    Raises
    ------
    ConfigError
        `interval` is set, and one of several videos has no clock.
    """
    intervals = _intervals(videos, interval)
    found: _Found = Counter(
        (intervals.number(index, event.time), (event.name, event.direction), class_of(event))
        for index, video in enumerate(videos)
        for event in video.events
    )
    directions = dict.fromkeys(key for video in videos for key in video.directions)
    return _rows(CountRow, intervals, found, directions)


def flow_table(videos: Sequence[Counts], interval: int | None = None) -> list[FlowRow]:
    """Return the flows in each interval, by class: from the first line or zone to the last.

    Both are the same if a vehicle returns. A flow counts in the interval of its first event.
    Parameters and errors as for `count_table`.
    """
    intervals = _intervals(videos, interval)
    found: _Found = Counter()
    for index, first, last in vehicle_flows(videos):
        flow = first.name, last.name if last else None
        found[intervals.number(index, first.time), flow, class_of(first)] += 1
    names = dict.fromkeys(name for video in videos for name, _ in video.directions)
    order = {name: number for number, name in enumerate((*names, None))}
    flows = sorted({flow for _, flow, _ in found}, key=lambda flow: [order[name] for name in flow])
    return _rows(FlowRow, intervals, found, flows)


def vehicle_flows(videos: Sequence[Counts]) -> Iterator[tuple[int, Event, Event | None]]:
    """Yield the first and last event of each vehicle that crosses a line or enters a zone.

    The number of the video of the first event precedes them; the last is None if there is only one.
    """
    trips: dict[int, list[tuple[int, Event]]] = {}
    for index, video in enumerate(videos):
        for event in video.events:
            if event.name not in video.zones or event.direction in _IN:
                trips.setdefault(event.vehicle, []).append((index, event))
    for (index, first), *others in trips.values():
        yield index, first, others[-1][1] if others else None


def zone_table(videos: Sequence[Counts], interval: int | None = None) -> list[ZoneRow]:
    """Return the use of each zone in each interval; parameters and errors as for `count_table`."""
    intervals = _intervals(videos, interval)
    rows = []
    for name in dict.fromkeys(name for video in videos for name in video.zones):
        visits: dict[int, list[_Visit]] = {number: [] for number in intervals.numbers}
        for index, video in enumerate(videos):
            for event in (event for event in video.events if event.name == name):
                time = intervals.seconds(index, event.time)
                visit = time, 1 if event.direction in _IN else -1, event.seconds
                visits[intervals.number_at(time)].append(visit)
        inside = 0
        for number, changes in visits.items():
            rows.append(_zone_row(name, intervals, number, changes, inside))
            inside += sum(change for _, change, _ in changes)
    return rows


_Visit = tuple[float, int, float | None]
"""When a vehicle enters (1) or leaves (-1) a zone, and if it leaves, how long it was inside."""


def _zone_row(
    name: str, intervals: Intervals, number: int, visits: Sequence[_Visit], inside: int
) -> ZoneRow:
    """Return the use in one interval, given the number of vehicles inside at its start."""
    begin, end = intervals.limits(number)
    visits = sorted(visits, key=lambda visit: visit[:2])  # at the same time, leaving comes first
    levels = list(accumulate((change for _, change, _ in visits), initial=inside))
    times = [begin, *(time for time, _, _ in visits), end]
    used = sum(n * (b - a) for n, (a, b) in zip(levels, pairwise(times), strict=True))
    covered = intervals.covered(number)  # 0 if the interval has only one frame
    stays = [stay for _, _, stay in visits if stay is not None]
    changes = sum(change > 0 for _, change, _ in visits), sum(change < 0 for _, change, _ in visits)
    mean = round(used / covered, 3) if covered else float(inside)
    stay = round(sum(stays) / len(stays), 3) if stays else None
    use = name, *changes, mean, max(levels), stay, max(stays, default=None)
    start, until = intervals.moments(number)
    return ZoneRow(start, until, *use)


def _intervals(videos: Sequence[Counts], interval: int | None) -> Intervals:
    return Intervals([(video.clock, video.spans) for video in videos], interval)


def class_of(event: Event) -> str:
    """Return the class of its vehicle, `UNKNOWN` if the detector has no classes."""
    return event.class_name or UNKNOWN


_Found = Counter[tuple[int, tuple[str, str | None], str]]
"""Number of vehicles by number of the interval, direction or flow, and class."""


def _rows(
    make: Callable[..., R],
    intervals: Intervals,
    found: _Found,
    pairs: Iterable[tuple[str, str | None]],
) -> list[R]:
    """Return a row for each interval, direction and class that occurs, even if its count is 0."""
    classes = sorted({name for _, _, name in found}) or [UNKNOWN]
    keys = [(pair, name) for pair in pairs for name in classes]
    return [
        make(*intervals.moments(number), *pair, name, found[number, pair, name])
        for number in intervals.numbers
        for pair, name in keys
    ]
