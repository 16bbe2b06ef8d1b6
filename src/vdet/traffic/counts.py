"""Events, and the tables computed from them: totals, flows and zones, by interval and class.

Tables cover the whole video or intervals of it. Several videos have one table.
"""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import datetime
from itertools import accumulate, chain, pairwise, product
from math import hypot
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from vdet.config.classes import UNKNOWN
from vdet.config.scene import NOWHERE
from vdet.errors import ArgumentError, needing, quantity
from vdet.findings import Finding, warnings_in
from vdet.traffic.clock import Clock, ClockTime, Interval, Intervals, Span
from vdet.traffic.crossings import APPEAR, ENTER

if TYPE_CHECKING:
    import pandas as pd

    from vdet.labels.label import SourceVideo

Direction = tuple[str, str]
"""Name of a line or zone, and of a direction."""
Flow = tuple[str, str | None]
"""Names of the first and the last line or zone of a vehicle; None if there is only one."""

_IN = ENTER, APPEAR

Key = TypeVar("Key", bound=tuple[str | None, ...])


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
        Score of the track in `frame`, 0 to 1; None if a reviewer added the event.
    seconds
        How long the vehicle was in the zone, for exit and vanish; else None.
    speed, speed_sd
        Speed at `time`, and its standard deviation, km/h; None if unknown.
    mean_speed
        Mean speed since the previous event of the same track, from the positions at both events,
        km/h; None if unknown.
    source
        "reviewer" if a reviewer added the event; its frame and id are -1.
    """

    time: float
    frame: int
    name: str
    direction: str
    id: int
    vehicle: int
    class_name: str | None
    score: float | None
    seconds: float | None = None
    speed: float | None = None
    speed_sd: float | None = None
    mean_speed: float | None = None
    source: str | None = None

    def order(self) -> tuple[float, int, int, str]:
        """Return a key that sorts events."""
        return self.time, self.frame, self.id, self.name


@dataclass(frozen=True, slots=True)
class GroupedEvent:
    """An event in the group of its direction, or the first event of a vehicle, in its flow.

    Attributes
    ----------
    video
        Number of the video.
    last
        In a flow, the last event of the vehicle; None if there is only one.
    """

    video: int
    event: Event
    last: Event | None = None


@dataclass(frozen=True, slots=True)
class DirectionTotal:
    """Number of vehicles in a direction, in total and by class.

    Attributes
    ----------
    counted
        Number before corrections.
    estimate
        Estimate of the true number; None if one of the videos has none.
    """

    name: str
    direction: str
    count: int
    classes: dict[str, int]
    counted: int
    estimate: "Estimate | None" = None


@dataclass(frozen=True, slots=True)
class CountRow:
    """Number of vehicles of a class in a direction of a line or zone, in an interval.

    Attributes
    ----------
    class_name
        `UNKNOWN` if the detector has no classes, as in `FlowRow`.
    observed, is_part
        As in `Interval`.
    per_hour
        Vehicles in an hour of video; None if the interval has only one frame.
    """

    start: ClockTime
    end: ClockTime
    name: str
    direction: str
    class_name: str
    count: int
    observed: float
    is_part: bool
    per_hour: float | None


@dataclass(frozen=True, slots=True)
class FlowRow:
    """Number of vehicles of a class from one line or zone to another, in an interval.

    The interval is that of the first event. `destination` is None for vehicles with one event only.
    Other values are as in `CountRow`.
    """

    start: ClockTime
    end: ClockTime
    origin: str
    destination: str | None
    class_name: str
    count: int
    observed: float
    is_part: bool
    per_hour: float | None


@dataclass(frozen=True, slots=True)
class ZoneRow:
    """The use of a zone in an interval.

    Attributes
    ----------
    entered, left
        Vehicles that entered or appeared, and that left or vanished.
    mean, max
        Mean and maximum number of vehicles inside, over the video in the interval; None if
        corrections leave a vehicle that entered and did not leave, or the reverse.
    mean_stay, max_stay
        Of the vehicles that left or vanished, seconds; None if none did.
    observed, is_part
        As in `Interval`.
    """

    start: ClockTime
    end: ClockTime
    name: str
    entered: int
    left: int
    mean: float | None
    max: int | None
    mean_stay: float | None
    max_stay: float | None
    observed: float
    is_part: bool


@dataclass(frozen=True, slots=True)
class VehicleGroup:
    """Vehicles in a direction of a line or zone, vehicles of a class, or all: `ALL`."""

    name: str | None = None
    direction: str | None = None
    class_name: str | None = None


ALL = VehicleGroup()


@dataclass(frozen=True, slots=True)
class Estimate:
    """The true number of vehicles of a group.

    Attributes
    ----------
    counted, corrected
        Number that was counted in all spans, and with all known errors corrected.
    true
        Estimate of the true number.
    low, high
        Its interval of 95 %.
    minutes_to_precision
        How many more drawn spans are expected to bring half of the width of the interval to 2 % of
        the true number; 0 if it is that narrow.
    """

    group: VehicleGroup
    counted: int
    corrected: int
    true: float
    low: float
    high: float
    minutes_to_precision: int


@dataclass(frozen=True, slots=True)
class Correction:
    """An event as it was counted, and as it is right; None: it was not counted, or is not right.

    `reviewer` and `saved` say who corrected it, and when, if that is known.
    """

    counted: Event | None
    right: Event | None
    reviewer: str | None = None
    saved: datetime | None = None

    @property
    def errors(self) -> dict[str, str | None]:
        """What is wrong, as files of corrections name it, and what is correct of it."""
        if not (self.counted and self.right):
            return {"false" if self.counted else "missed": None}
        before, after = (
            {"class": class_of(event), "direction": event.direction}
            for event in (self.counted, self.right)
        )
        return {name: after[name] for name in before if before[name] != after[name]}

    @property
    def record(self) -> dict[str, Any]:
        """The values for tables and JSON."""
        event = self.counted or self.right
        assert event
        place = {"time": event.time, "name": event.name, "direction": event.direction}
        correct = [value for value in self.errors.values() if value]
        errors = {"class": class_of(event), "error": list(self.errors), "correct": correct}
        return {**place, **errors, "reviewer": self.reviewer, "saved": self.saved}


@dataclass(frozen=True, slots=True)
class Corrected:
    """How counts were corrected.

    Attributes
    ----------
    counted
        The events before.
    corrections
        What was corrected.
    files
        The names of the files of corrections.
    names
        The lines and zones that were checked.
    checked
        When all of these were checked, seconds in the video.
    observed
        How many seconds the video has.
    estimates
        The true number of events at these lines and zones: of all, of each direction, and of each
        class; empty if too little of a sample was checked.
    faults
        A sentence for each correction that does not fit the counts.
    """

    counted: tuple[Event, ...] = ()
    corrections: tuple[Correction, ...] = ()
    files: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    checked: tuple[Span, ...] = ()
    observed: float = 0.0
    estimates: tuple[Estimate, ...] = ()
    faults: tuple[str, ...] = ()

    def __str__(self) -> str:
        events = f"corrected: {quantity(len(self.corrections), 'event')}"
        text = f"{events}, by {', '.join(self.files)}; minutes checked: {self.minutes}"
        for total in self.estimates[:1]:
            true, low, high = map(round, (total.true, total.low, total.high))
            text += f"; at checked lines {total.counted} counted, {total.corrected} corrected, "
            text += f"{true} estimated (95 %: {low} to {high})"
        return text

    @property
    def minutes(self) -> str:
        """How many minutes were checked, and of how many."""
        checked = sum(end - start for start, end in self.checked)
        return f"{minutes(checked)} of {minutes(self.observed)}"


@dataclass(frozen=True, slots=True)
class Trace:
    """Something that passed a band like a vehicle, without a track.

    Attributes
    ----------
    band, name
        Number of the band from 0, and name of its line or zone.
    time, position
        Seconds in the video, and fraction of the length of the band, 0 to 1.
    """

    band: int
    name: str
    time: float
    position: float


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
    findings
        Reasons to doubt the tracks and the counts: also misplaced lines, a low frame rate, and
        impossible lengths of cars.
    corrected
        What a reviewer corrected; None if nothing was.
    outside_flows
        The names of the lines and zones at which flows neither begin nor end.
    classes
        The classes of vehicles that can be counted; those of tracks may be others.
    source
        The video; None if unknown.
    left_out
        Until when frames are not counted because another video has them, seconds; None: no frames.
    traces
        What passed without a track, if strips were searched for it.
    """

    events: tuple[Event, ...]
    directions: tuple[Direction, ...]
    zones: tuple[str, ...]
    spans: tuple[Span, ...] = ((0.0, 0.0),)
    clock: Clock | None = None
    findings: tuple[Finding, ...] = ()
    corrected: Corrected | None = None
    traces: tuple[Trace, ...] = ()
    outside_flows: tuple[str, ...] = ()
    classes: tuple[str, ...] = ()
    source: "SourceVideo | None" = field(default=None, compare=False)
    left_out: float | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence for each finding by which the counts may be wrong."""
        return tuple(map(str, warnings_in(self.findings)))

    @property
    def flow_names(self) -> tuple[str, ...]:
        """The lines and zones at which flows begin and end."""
        names = dict.fromkeys(name for name, _ in self.directions)
        return tuple(name for name in names if name not in self.outside_flows)

    @property
    def uncorrected(self) -> "Counts":
        """The counts before corrections."""
        return replace(self, events=self.corrected.counted) if self.corrected else self

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

        names = [column.name for column in fields(CountRow)]
        return pd.DataFrame(self.table(interval), columns=names)


class EventGroups:
    """The events of videos, grouped once: tables, charts and sheets are views of these groups.

    Attributes
    ----------
    directions
        All events of each direction of each line and zone.
    flows
        The first event of each vehicle that crosses a line or enters a zone, by the line or zone of
        this event and of the last one, the largest flow first.
    """

    def __init__(self, videos: Sequence[Counts]) -> None:
        self._videos = videos
        self.directions: dict[Direction, list[GroupedEvent]] = {
            direction: [] for video in videos for direction in video.directions
        }
        visits: dict[int, list[GroupedEvent]] = {}
        for number, video in enumerate(videos):
            names = set(video.flow_names)
            for event in video.events:
                grouped = GroupedEvent(number, event)
                self.directions[event.name, event.direction].append(grouped)
                is_visit = event.name not in video.zones or event.direction in _IN
                if is_visit and event.name in names:
                    visits.setdefault(event.vehicle, []).append(grouped)
        flows: dict[Flow, list[GroupedEvent]] = {}
        for first, *later in visits.values():
            trip = replace(first, last=later[-1].event if later else None)
            destination = trip.last.name if trip.last else None
            flows.setdefault((trip.event.name, destination), []).append(trip)
        self.flows = dict(sorted(flows.items(), key=lambda flow: -len(flow[1])))

    @property
    def flow_names(self) -> list[str]:
        """The lines and zones at which flows begin and end."""
        return list(dict.fromkeys(name for video in self._videos for name in video.flow_names))

    @property
    def ordered_flows(self) -> list[Flow]:
        """The flows in the order of the lines and zones."""
        names: list[str | None] = [*self.flow_names, None]
        return sorted(self.flows, key=lambda flow: list(map(names.index, flow)))

    @property
    def classes(self) -> list[str]:
        """The classes in the columns of a table: equal for all videos of one camera.

        They are those of the settings, then all others that were counted. `UNKNOWN` stands for all
        vehicles of a detector without classes.
        """
        counted = {event.class_name for video in self._videos for event in video.events}
        if counted <= {None} and counted:
            return [UNKNOWN]
        listed = (name for video in self._videos for name in video.classes)
        others = sorted(name or UNKNOWN for name in counted)
        return list(dict.fromkeys((*listed, *others))) or [UNKNOWN]

    def intervals(self, length: int | None = None) -> Intervals:
        """Return the intervals of the videos; errors as for `count_table`."""
        if length is not None and length < 1:
            raise ArgumentError(f"interval: must be at least 1 second, not {length}")
        return Intervals([(video.clock, video.spans) for video in self._videos], length)

    def tally(
        self, groups: Mapping[Key, Iterable[GroupedEvent]], length: int | None = None
    ) -> "Tally[Key]":
        """Count the events of each group by intervals of a length, seconds; None for one."""
        intervals = self.intervals(length)
        numbers = Counter[tuple[int | None, Key | None, str | None]]()
        for key, group in groups.items():
            for item in group:
                number = intervals.number(item.video, item.event.time)
                numbers.update(product((number, None), (key, None), (class_of(item.event), None)))
        return Tally(intervals, numbers)


@dataclass(frozen=True, slots=True)
class Tally(Generic[Key]):
    """Numbers of events by interval, key of the group, and class; None stands for all of them."""

    intervals: Intervals
    numbers: Counter[tuple[int | None, Key | None, str | None]]

    @property
    def classes(self) -> set[str]:
        """The classes that occur."""
        return {kind for _, _, kind in self.numbers if kind}

    def rows(self, keys: Iterable[Key], more: Collection[str] = ()) -> Iterator[tuple[Any, ...]]:
        """Yield the values of each interval, key, and class that occurs or is one of `more`."""
        classes = sorted({*self.classes, *more}) or [UNKNOWN]
        for period, key, kind in product(self.intervals.periods, keys, classes):
            count = self.numbers[period.number, key, kind]
            flow = period.observed, period.is_part, per_hour(count, period.observed)
            yield period.start, period.end, *key, kind, count, *flow


def direction_totals(videos: Sequence[Counts]) -> tuple[DirectionTotal, ...]:
    """Return the totals of each direction over all videos."""
    counted = EventGroups([video.uncorrected for video in videos]).directions
    estimates = defaultdict[Any, list[Estimate]](list)
    for item in (e for v in videos if v.corrected for e in v.corrected.estimates):
        estimates[item.group.name, item.group.direction].append(item)
    totals = []
    for way, group in EventGroups(videos).directions.items():
        classes = Counter(kind for item in group if (kind := item.event.class_name))
        estimate = _summed(estimates[way]) if len(estimates[way]) == len(videos) else None
        by_class = dict(sorted(classes.items()))
        totals.append(DirectionTotal(*way, len(group), by_class, len(counted[way]), estimate))
    return tuple(totals)


def _summed(estimates: Sequence[Estimate]) -> Estimate:
    """Return the estimate for several videos, whose errors are independent."""
    true = sum(item.true for item in estimates)
    return replace(
        estimates[0],
        counted=sum(item.counted for item in estimates),
        corrected=sum(item.corrected for item in estimates),
        true=true,
        low=true - hypot(*(item.true - item.low for item in estimates)),
        high=true + hypot(*(item.high - item.true for item in estimates)),
    )


def seconds_checked(
    videos: Sequence[Counts], intervals: Intervals, period: Interval, name: str | None
) -> float:
    """Return how many seconds of an interval were checked at a line or zone."""
    spans = (
        (intervals.seconds(number, start), intervals.seconds(number, end))
        for number, counts in enumerate(videos)
        if counts.corrected and name in counts.corrected.names
        for start, end in counts.corrected.checked
    )
    common = (min(end, period.last) - max(start, period.first) for start, end in spans)
    return round(sum(seconds for seconds in common if seconds > 0), 3)


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
    ArgumentError
        `interval` is less than 1.
    """
    groups = EventGroups(videos)
    tally = groups.tally(groups.directions, interval)
    return [CountRow(*values) for values in tally.rows(groups.directions)]


def flow_table(videos: Sequence[Counts], interval: int | None = None) -> list[FlowRow]:
    """Return the flows in each interval, by class: from the first line or zone to the last.

    Both are the same if a vehicle returns. A flow counts in the interval of its first event.
    Parameters and errors as for `count_table`.
    """
    groups = EventGroups(videos)
    tally = groups.tally(groups.flows, interval)
    return [FlowRow(*values) for values in tally.rows(groups.ordered_flows)]


def minutes(seconds: float) -> str:
    """Return seconds as minutes, in one digit after the point at least."""
    return f"{round(seconds / 60, 1 if seconds >= 60 else 2):g}"


def per_hour(count: float, seconds: float) -> float | None:
    """Return the number of vehicles per hour of video; None with less than a minute of it."""
    return round(3600 * count / seconds, 1) if seconds >= 60 else None


def zone_table(videos: Sequence[Counts], interval: int | None = None) -> list[ZoneRow]:
    """Return the use of each zone in each interval; parameters and errors as for `count_table`."""
    intervals = EventGroups(videos).intervals(interval)
    rows = []
    for name in dict.fromkeys(name for video in videos for name in video.zones):
        changes: defaultdict[int, list[_Change]] = defaultdict(list)
        for index, video in enumerate(videos):
            for event in (event for event in video.events if event.name == name):
                time = intervals.seconds(index, event.time)
                change = _Change(time, 1 if event.direction in _IN else -1, event.seconds)
                changes[intervals.number_at(time)].append(change)
        inside, of_zone = 0, list[ZoneRow]()
        levels = list(accumulate(c.vehicles for c in sorted(chain.from_iterable(changes.values()))))
        is_known = not any(video.corrected for video in videos) or is_balanced(levels)
        for period in intervals.periods:
            of_zone.append(_zone_row(name, period, sorted(changes[period.number]), inside))
            inside += sum(change.vehicles for change in changes[period.number])
        rows += of_zone if is_known else [replace(row, mean=None, max=None) for row in of_zone]
    return rows


def is_balanced(levels: Sequence[int]) -> bool:
    """Return whether numbers of vehicles inside a zone are possible, and nobody remains."""
    return not levels or (min(levels) >= 0 and levels[-1] == 0)


def unbalanced_zones(video: Counts) -> list[str]:
    """Return the zones that more vehicles leave than enter, or the reverse."""
    changes: dict[str, list[int]] = {name: [] for name in video.zones}
    for event in video.events:
        if event.name in changes:
            changes[event.name].append(1 if event.direction in _IN else -1)
    return [name for name, each in changes.items() if not is_balanced(list(accumulate(each)))]


@dataclass(frozen=True, slots=True, order=True)
class _Change:
    """A vehicle enters (1) or leaves (-1) a zone; `stay` is how long it was inside, if it leaves.

    At the same time, leaving comes first.
    """

    time: float
    vehicles: int
    stay: float | None = field(compare=False)


def _zone_row(name: str, period: Interval, changes: Sequence[_Change], inside: int) -> ZoneRow:
    """Return the use in one interval, with `inside` vehicles at its start."""
    levels = list(accumulate((change.vehicles for change in changes), initial=inside))
    times = [period.first, *(change.time for change in changes), period.last]
    used = sum(n * (b - a) for n, (a, b) in zip(levels, pairwise(times), strict=True))
    stays = [change.stay for change in changes if change.stay is not None]
    return ZoneRow(
        start=period.start,
        end=period.end,
        name=name,
        entered=sum(change.vehicles > 0 for change in changes),
        left=sum(change.vehicles < 0 for change in changes),
        # Without seconds, it has only one frame.
        mean=round(used / period.observed, 3) if period.observed else float(inside),
        max=max(levels),
        mean_stay=round(sum(stays) / len(stays), 3) if stays else None,
        max_stay=max(stays, default=None),
        observed=period.observed,
        is_part=period.is_part,
    )


def class_of(event: Event) -> str:
    """Return the class of its vehicle, `UNKNOWN` if the detector has no classes."""
    return event.class_name or UNKNOWN


def names_in(key: Iterable[str | None]) -> list[str]:
    """Return the names in the key of a group, `NOWHERE` for None."""
    return [NOWHERE if name is None else name for name in key]
