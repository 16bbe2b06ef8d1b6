"""The tables of a survey, for its workbook and its page."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import groupby, product

from vdet.config.schema import Settings
from vdet.config.shapes import NOWHERE
from vdet.errors import ConfigError, counted
from vdet.traffic import counts as tables
from vdet.traffic import measures
from vdet.traffic.clock import ClockTime, Interval, Intervals
from vdet.traffic.counts import CountRow, Counts, Event, FlowRow, ZoneRow, class_of
from vdet.traffic.workbook import Cell, Column, Sheet, SheetTable
from vdet.version import __version__

_TIMES = (
    Column("start", 20),
    Column("end", 20),
    Column("observed, s", 10, "0"),
    Column("part", 6),
)
_PEAK = Column("peak hour", 20), Column("vehicles in it"), Column("peak hour factor", 10, "0.00")
_ALL = "all"
_NAME = 18
"""Width of a column of names."""
_NOTES = f"""\
part: there is no video in more than a second of the interval. Per hour: of the time observed.
peak hour: the four successive quarters of an hour, all observed, with the most vehicles. Its \
factor is this number divided by four times that of the busiest quarter.
heavy: the share of trucks and buses.
turning movements: N left is from the northern arm of the junction to the left.
flow: from the first line or zone of a vehicle to the last, in the interval of the first. \
{NOWHERE}: it was counted at one only; turning movements leave it out."""


@dataclass(frozen=True, slots=True)
class _Group:
    """The columns with the number of vehicles in a group; `units` are passenger car units."""

    classes: Sequence[str]
    units: Mapping[str, float]

    @property
    def columns(self) -> list[Column]:
        names = [Column(name, 11) for name in self.classes] if len(self.classes) > 1 else []
        heavy = [Column("heavy", 8, "0.0%")] if names else []
        units = [Column("PCU", 9, "0.0")] if self.units else []
        return [*names, Column("all vehicles"), Column("per hour", 9, "0"), *heavy, *units]

    def cells(self, numbers: Mapping[str, int], seconds: float) -> list[Cell]:
        """Return the cells, from the number of vehicles of each class in some seconds of video."""
        by_class: list[Cell] = [numbers.get(name, 0) for name in self.classes]
        total, has_classes = sum(numbers.values()), len(self.classes) > 1
        return [
            *(by_class if has_classes else ()),
            total,
            tables.per_hour(total, seconds),
            *([measures.heavy_share(numbers)] if has_classes else ()),
            *([measures.passenger_car_units(numbers, self.units)] if self.units else ()),
        ]


class Survey:
    """The tables of a survey; a table is None if there is nothing that it could show.

    Parameters
    ----------
    videos
        The counts of its videos by their names.

    Raises
    ------
    ConfigError
        As `count_table`.
    """

    def __init__(self, videos: Mapping[str, Counts], settings: Settings) -> None:
        self._videos, self._settings = videos, settings
        self._counts, self._length = list(videos.values()), settings.traffic.seconds
        self._group = _Group(tables.class_columns(self._counts), settings.traffic.pcu)
        self._whole = self._intervals(None).periods[0]

    def sheets(self, picture: bytes | None = None) -> list[Sheet]:
        """Return the sheets of the workbook; `picture` is the scene, as for `Sheet`."""
        single = {
            "Intervals": self.intervals(),
            "Flows": self.flows(),
            "Turning movements": self.movements(),
            "Zones": self.zones(),
            "Vehicles": self.vehicles(),
            "Files": self.files(),
            "Notes": self.notes(),
        }
        summary = Sheet("Summary", [self.facts(), self.volumes()], picture)
        return [summary, *(Sheet(name, [table]) for name, table in single.items() if table)]

    def _intervals(self, length: int | None) -> Intervals:
        return Intervals([(counts.clock, counts.spans) for counts in self._counts], length)

    def facts(self) -> SheetTable:
        """Return what the survey is, when and how it was made, and whether it is in doubt."""
        survey, whole = self._settings.survey, self._whole
        checks = [str(counts.corrected) for counts in self._counts if counts.corrected]
        doubts = sum(len(counts.doubts + counts.warnings) for counts in self._counts)
        clocks = dict.fromkeys(counts.clock.source for counts in self._counts if counts.clock)
        times = (time for time in (whole.start, whole.end) if isinstance(time, datetime))
        zones = [f"UTC{time.isoformat()[-6:]}" for time in times]
        facts: list[tuple[str, Cell]] = [
            ("surveyor", survey.surveyor),
            ("weather", survey.weather),
            ("files", counted(len(self._videos), "file")),
            ("first frame", _time(whole.start)),
            ("last frame", _time(whole.end)),
            ("observed", timedelta(seconds=whole.observed)),
            ("time zone", ", ".join(dict.fromkeys(zones))),
            ("clock", ", ".join(clocks) or "unknown: times are those of the video"),
            ("interval", self._settings.traffic.interval or "the whole time"),
            ("checked", "; ".join(checks) or "no, counted automatically"),
            ("conditions", f"{counted(doubts, 'doubt')}: see Notes" if doubts else "no doubts"),
            ("program", f"vdet {__version__}"),
        ]
        rows = [fact for fact in facts if fact[1]]
        return SheetTable([Column(), Column()], rows, survey.site or "Traffic survey")

    def volumes(self) -> SheetTable:
        """Return the number of vehicles in each direction, and their peak hour."""
        quarters = None
        with suppress(ConfigError):  # there is no clock
            quarters = self._intervals(measures.QUARTER)
        groups: dict[tuple[str, str], list[tuple[int, Event]]] = {
            direction: [] for counts in self._counts for direction in counts.directions
        }
        for index, counts in enumerate(self._counts):
            for event in counts.events:
                groups[event.name, event.direction].append((index, event))
        flows = tables.vehicle_flows(self._counts)
        groups["all flows", ""] = [(index, first) for index, first, _ in flows]
        names = Column("line or zone", _NAME), Column("direction", _NAME)
        rows = [[*pair, *self._volume(events, quarters)] for pair, events in groups.items()]
        return SheetTable([*names, *self._group.columns, *_PEAK], rows, "Volumes")

    def _volume(
        self, events: Sequence[tuple[int, Event]], quarters: Intervals | None
    ) -> list[Cell]:
        numbers = Counter(class_of(event) for _, event in events)
        cells, peak = self._group.cells(numbers, self._whole.observed), None
        if quarters:
            by_quarter = Counter(quarters.number(index, event.time) for index, event in events)
            peak = measures.peak_hour(quarters.periods, by_quarter)
        return [*cells, *((_time(peak.start), peak.vehicles, peak.factor) if peak else [None] * 3)]

    def intervals(self) -> SheetTable:
        """Return the number of vehicles in each direction and interval."""
        return self._by_class(
            ("line or zone", "direction"), tables.count_table(self._counts, self._length)
        )

    def flows(self) -> SheetTable:
        """Return the flows in each interval."""
        return self._by_class(("from", "to"), tables.flow_table(self._counts, self._length))

    def _by_class(self, names: Iterable[str], rows: Sequence[CountRow | FlowRow]) -> SheetTable:
        """Return a table with a column for each class, from rows with one class."""
        columns = [*_TIMES, *(Column(name, _NAME) for name in names), *self._group.columns]
        return SheetTable(columns, self._cells_by_class(rows))

    def _cells_by_class(self, rows: Sequence[CountRow | FlowRow]) -> Iterator[list[Cell]]:
        for _, group in groupby(rows, key=lambda row: (row.start, _names(row))):
            by_class = list(group)
            first, numbers = by_class[0], {row.class_name: row.count for row in by_class}
            cells = self._group.cells(numbers, first.observed)
            yield [*_interval_cells(first), *_names(first), *cells]

    def movements(self) -> SheetTable | None:
        """Return how vehicles turn, by interval; the arms are clockwise from the north."""
        arm_of = {line.name: line.approach for line in self._settings.traffic.lines}
        arms = [arm for arm in measures.APPROACHES if arm in arm_of.values()]
        if not arms:
            return None
        intervals, numbers = self._intervals(self._length), Counter[tuple[int, str, str]]()
        for index, first, last in tables.vehicle_flows(self._counts):
            origin, destination = arm_of.get(first.name), arm_of.get(last.name) if last else None
            if origin and destination:
                turn = measures.movement(origin, destination)
                for total in (turn, _ALL):
                    numbers[intervals.number(index, first.time), origin, total] += 1
        turns = list(product(arms, (*measures.MOVEMENTS, _ALL)))
        columns = [*_TIMES, *(Column(f"{arm} {turn}") for arm, turn in turns)]
        rows = (
            [*_interval_cells(period), *(numbers[period.number, *turn] for turn in turns)]
            for period in intervals.periods
        )
        return SheetTable(columns, rows)

    def zones(self) -> SheetTable | None:
        """Return the use of zones in each interval."""
        numbers = ("entered", "left", "mean", "max", "mean stay, s", "max stay, s")
        columns = [*_TIMES, Column("zone", _NAME), *(Column(name, 9) for name in numbers)]
        rows = []
        for row in tables.zone_table(self._counts, self._length):
            use = row.entered, row.left, row.mean, row.max, row.mean_stay, row.max_stay
            rows.append([*_interval_cells(row), row.name, *use])
        return SheetTable(columns, rows) if rows else None

    def vehicles(self) -> SheetTable:
        """Return every passage of a vehicle at a line or zone."""
        columns = (
            *(Column("clock", 19), Column("time in the video", 11), Column("file", 30)),
            *(Column("line or zone", _NAME), Column("direction", _NAME), Column("vehicle", 9)),
            *(Column("class", 12), Column("score", 7, "0.00"), Column("seconds in zone", 9)),
            *(Column("km/h", 7, "0.0"), Column("mean km/h", 7, "0.0")),
        )
        return SheetTable(columns, self._passages())

    def _passages(self) -> Iterator[list[Cell]]:
        for name, counts in self._videos.items():
            for event in counts.events:
                clock = counts.clock.at(event.time) if counts.clock else None
                passage = event.name, event.direction, event.vehicle, class_of(event), event.score
                measured = event.seconds, event.speed, event.mean_speed
                yield [clock, _time(event.time), name, *passage, *measured]

    def files(self) -> SheetTable:
        """Return when each file was recorded, and how that is known."""
        columns = (
            *(Column("file", 40), Column("first frame", 19), Column("last frame", 19)),
            *(Column("observed", 10), Column("clock", 24), Column("events"), Column("doubts")),
        )
        rows = []
        for name, counts in self._videos.items():
            period = Intervals([(counts.clock, counts.spans)], None).periods[0]
            clock = counts.clock.source if counts.clock else "unknown"
            doubts = len(counts.doubts + counts.warnings)
            times = [_time(period.start), _time(period.end), timedelta(seconds=period.observed)]
            rows.append([name, *times, clock, len(counts.events), doubts])
        return SheetTable(columns, rows)

    def notes(self) -> SheetTable:
        """Return the warnings and doubts of each file, and what the sheets mean."""
        rows: list[list[Cell]] = [
            [name, text]
            for name, counts in self._videos.items()
            for text in (*counts.doubts, *counts.warnings)
        ]
        units = (f"{name} {number:g}" for name, number in self._settings.traffic.pcu.items())
        texts = [
            *_NOTES.splitlines(),
            *([f"PCU: {', '.join(units)}; others 1."] if self._group.units else ()),
        ]
        rows += [["", text] for text in texts]
        return SheetTable([Column("file", 40), Column("note", 110, is_wrapped=True)], rows)


def _time(value: ClockTime) -> Cell:
    """Return a clock time, or seconds of a video, as a cell."""
    return timedelta(seconds=value) if isinstance(value, int | float) else value


def _interval_cells(row: CountRow | FlowRow | ZoneRow | Interval) -> list[Cell]:
    return [_time(row.start), _time(row.end), row.observed, "part" if row.is_part else None]


def _names(row: CountRow | FlowRow) -> tuple[str, str]:
    if isinstance(row, CountRow):
        return row.name, row.direction
    return row.origin, row.destination or NOWHERE
