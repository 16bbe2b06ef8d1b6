"""The tables of a survey, for its workbook and its pages, with the measures of traffic engineers.

The peak hour and its factor are those of the Highway Capacity Manual: the four successive quarters
of an hour with the most vehicles, and their number divided by four times that of the busiest.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import datetime, timedelta
from itertools import chain, product

import numpy as np

from vdet.boxes import Image
from vdet.config.scene import APPROACHES, NOWHERE, Approach, LineSettings
from vdet.config.schema import Settings
from vdet.errors import ConfigError, quantity
from vdet.traffic import counts as tables
from vdet.traffic.clock import SEAM, ClockTime, Interval, Intervals
from vdet.traffic.counts import (
    Counts,
    Estimate,
    GroupedEvent,
    Key,
    Tally,
    ZoneRow,
    class_of,
    names_in,
    seconds_checked,
)
from vdet.traffic.output import Cell, Sheet, SheetTable
from vdet.version import __version__

_TIMES = "start", "end", "observed, s", "part"
_DIRECTION = "line or zone", "direction"
_FLOW = "from", "to"
_PEAK = "peak hour", "vehicles in it", "peak hour factor"
_ESTIMATED = "estimated", "at least (95 %)", "at most (95 %)"
_ESTIMATE = *_DIRECTION, "class", "counted", "corrected", *_ESTIMATED
_CHECKED = "counted", "corrected", *_ESTIMATED
_SPEEDS = "median km/h", "85 % km/h"
_ALL = "all"
_MOST = 3
"""Maximum number of doubts in the summary."""
_NOTES = f"""\
part: there is no video in more than a second of the interval. Per hour: of the time observed.
peak hour: the four successive quarters of an hour, all observed, with the most vehicles. Its \
factor is this number divided by four times that of the busiest quarter.
heavy: the share of trucks and buses. all flows: each vehicle once, at its first line or zone.
flow: from the first line or zone of a vehicle to the last, in the interval of the first. \
{NOWHERE}: it was counted at one only.
turning movement: N left is from the northern arm of the junction to the left. from unknown to N: \
it was only seen to leave by this arm.
checks: the true number of passages at all checked lines and zones, with its interval of 95 %.
counted: by vdet. corrected, all vehicles: by reviewers. estimated: by checked spans."""

QUARTER = 900
"""Seconds."""
HEAVY = "truck", "bus"
"""The classes of heavy vehicles."""
HEAVY_NAMED = "of 98 trucks that it found on unseen cameras, the shipped network named 57 right"
"""How far to trust their share; docs/accuracy.md says how it was measured."""
MOVEMENTS = "left", "through", "right", "U-turn"


class Survey:
    """The tables of a survey; a table is None if there is nothing that it could show.

    Parameters
    ----------
    videos
        The counts of its videos by their names.

    Attributes
    ----------
    counts
        Those of each video.
    groups
        Their events.

    Raises
    ------
    ConfigError
        As `count_table`.
    """

    def __init__(self, videos: Mapping[str, Counts], settings: Settings) -> None:
        self.videos, self.settings = videos, settings
        self.counts = list(videos.values())
        self.groups = tables.EventGroups(self.counts)
        self._classes = self.groups.classes
        self._whole = self.groups.intervals().periods[0]

    def sheets(self, picture: Image | None = None) -> list[Sheet]:
        """Return the sheets of the workbook; `picture` is the scene, as for `Sheet`."""
        single = {
            "Intervals": self._by_interval(_DIRECTION, self.groups.directions),
            "Flows": self._by_interval(_FLOW, self.groups.flows),
            "Checks": self._corrections(),
            "Turning movements": self._movements(),
            "Zones": self._zones(),
            "Vehicles": self._vehicles(),
            "Files": self.files(),
            "Notes": self.notes(),
        }
        checks = self.checks()
        top = [self.facts(), *([checks] if checks.rows else []), self.volumes()]
        summary = Sheet("Summary", top, picture)
        others = (Sheet(n, [t], printed=n != "Vehicles") for n, t in single.items() if t.rows)
        return [summary, *others]

    def facts(self) -> SheetTable:
        """Return what the survey is, when and how it was made, and whether it is in doubt."""
        survey, whole = self.settings.survey, self._whole
        files = quantity(len(self.videos), "file")
        doubts = list(dict.fromkeys(text for counts in self.counts for text in counts.warnings))
        if more := len(doubts[_MOST:]):
            doubts[_MOST:] = [f"and {quantity(more, 'other')}, see Notes"]
        still = set.intersection(*(_nothing_found(counts) for counts in self.counts))
        clocks = dict.fromkeys(counts.clock.source for counts in self.counts if counts.clock)
        times = (time for time in (whole.start, whole.end) if isinstance(time, datetime))
        zones = dict.fromkeys(f"UTC{time.isoformat()[-6:]}" for time in times)
        facts: dict[str, Cell] = {
            "surveyor": survey.surveyor,
            "weather": survey.weather,
            "files": files,
            "first frame": _time(whole.start),
            "last frame": _time(whole.end),
            "observed": timedelta(seconds=whole.observed),
            "time zone": ", ".join(zones) or None,
            "clock": ", ".join(clocks) or "unknown: times are those of the video",
            "interval": self.settings.traffic.interval or "the whole time",
            "checked": self._checked(),
            "conditions": "; ".join(doubts or ["no doubts", *still]),
            "heavy share": HEAVY_NAMED if len(self._classes) > 1 else None,
            "program": f"vdet {__version__}",
        }
        rows = [fact for fact in facts.items() if fact[1] is not None]
        return SheetTable((), rows, survey.site or "Traffic survey")

    def _checked(self) -> str:
        """Return how many minutes of all files were checked."""
        every = [counts.corrected for counts in self.counts if counts.corrected]
        checked = sum(end - start for item in every for start, end in item.checked)
        if not every:
            return "no, counted automatically"
        observed = tables.minutes(self._whole.observed)
        return f"{tables.minutes(checked)} of {observed} minutes"

    def volumes(self) -> SheetTable:
        """Return the number of vehicles in each direction, their peak hour and their speeds."""
        groups = self.groups
        rows = [*self._volumes(groups.directions, groups.directions)]
        rows += self._volumes(groups.flows, [None])
        total = _CHECKED if self._is_corrected else self._headings[:1]
        headings = [*_DIRECTION, *total, *self._headings[1:], *_PEAK, *_SPEEDS]
        return SheetTable(headings, rows, "Volumes").without_empty_columns()

    def _volumes(
        self, groups: Mapping[Key, Sequence[GroupedEvent]], keys: Iterable[Key | None]
    ) -> Iterator[list[Cell]]:
        """Yield the volumes of groups; None stands for all flows."""
        whole, quarters = self.groups.tally(groups), None
        with suppress(ConfigError):  # there is no clock
            quarters = self.groups.tally(groups, QUARTER)
        before = self._before
        for key in keys:
            events = chain.from_iterable(groups.values()) if key is None else groups[key]
            names = names_in(key or ("all flows", ""))
            total, *cells = self._cells(whole, key)
            counted, estimate = before[key]
            totals = [counted, total, *_limits(estimate)] if self._is_corrected else [total]
            yield [*names, *totals, *cells, *_peak_hour(quarters, key), *_speeds(events)]

    @property
    def _before(self) -> dict[tuple[str | None, ...] | None, tuple[int, Estimate | None]]:
        """What was counted before corrections, and is estimated, by direction; None: all flows."""
        flows = tables.EventGroups([counts.uncorrected for counts in self.counts]).flows
        before: dict[tuple[str | None, ...] | None, tuple[int, Estimate | None]] = {
            None: (sum(map(len, flows.values())), None)
        }
        for total in tables.direction_totals(self.counts):
            before[total.name, total.direction] = total.counted, total.estimate
        return before

    @property
    def _is_corrected(self) -> bool:
        return any(counts.corrected for counts in self.counts)

    def flows(self) -> SheetTable:
        """Return the number of vehicles in each flow, the largest flow first."""
        tally = self.groups.tally(self.groups.flows)
        rows = [[*names_in(flow), *self._cells(tally, flow)] for flow in self.groups.flows]
        return SheetTable([*_FLOW, *self._headings], rows)

    def _by_interval(
        self, names: Sequence[str], groups: Mapping[Key, Sequence[GroupedEvent]]
    ) -> SheetTable:
        """Return the number of vehicles in each group and interval."""
        tally = self.groups.tally(groups, self.settings.traffic.seconds)
        rows = []
        for period, key in product(tally.intervals.periods, groups):
            checked: list[Cell] = [seconds_checked(self.counts, tally.intervals, period, key[0])]
            cells = self._cells(tally, key, period)
            rows.append([*_interval(period), *checked * self._is_corrected, *names_in(key), *cells])
        headings = [*_TIMES, *["checked, s"] * self._is_corrected]
        return SheetTable([*headings, *names, *self._headings], rows)

    @property
    def _headings(self) -> list[str]:
        """The headings of the numbers of vehicles."""
        classes = [*self._classes, "heavy, %"] if len(self._classes) > 1 else []
        units = ["PCU"] if self.settings.traffic.pcu else []
        return ["all vehicles", "per hour", *classes, *units]

    def _cells(
        self, tally: Tally[Key], key: Key | None, period: Interval | None = None
    ) -> list[Cell]:
        """Return the cells below `_headings`, for events in a period; None: the whole time."""
        number = period.number if period else None
        numbers = {name: tally.numbers[number, key, name] for name in self._classes}
        total, units = tally.numbers[number, key, None], self.settings.traffic.pcu
        cells: list[Cell] = [total, tables.per_hour(total, (period or self._whole).observed)]
        if len(numbers) > 1:
            heavy = sum(numbers.get(name, 0) for name in HEAVY)
            cells += [*numbers.values(), round(100 * heavy / total, 1) if total else None]
        if units:
            cells.append(sum(count * units.get(name, 1.0) for name, count in numbers.items()))
        return cells

    def _movements(self) -> SheetTable:
        """Return how vehicles turn, by interval; the arms are clockwise from the north."""
        lines = self.settings.traffic.lines
        arm_of, ways_out = {line.name: line.approach for line in lines}, exits(lines)
        arms = [arm for arm in APPROACHES if arm in arm_of.values()]
        turns = product(arms, (*MOVEMENTS, _ALL))
        turning: dict[tuple[str, ...], list[GroupedEvent]] = {turn: [] for turn in turns}
        for (first, last), trips in self.groups.flows.items():
            origin, destination = arm_of.get(first), arm_of.get(last or NOWHERE)
            if origin and destination:
                turning[origin, movement(origin, destination)] += trips
                turning[origin, _ALL] += trips
            for trip in trips if origin and not last else ():
                is_exit = (first, trip.event.direction) in ways_out
                ends = ("unknown", "to", origin) if is_exit else (origin, "to", "unknown")
                turning.setdefault(("from", *ends), []).append(trip)
        tally = self.groups.tally(turning, self.settings.traffic.seconds)
        rows: list[list[Cell]] = [
            [*_interval(period), *(tally.numbers[period.number, turn, None] for turn in turning)]
            for period in tally.intervals.periods
        ]
        rows.append([_ALL, None, None, None, *map(len, turning.values())])
        every = sum(map(len, self.groups.flows.values()))
        lost = every - sum(len(turning[arm, _ALL]) for arm in arms)
        title = f"{lost} of {quantity(every, 'vehicle')} without an origin or a destination"
        return SheetTable([*_TIMES, *map(" ".join, turning)], rows if arms else [], title)

    def _zones(self) -> SheetTable:
        """Return the use of zones in each interval."""
        headings = "zone", "entered", "left", "mean inside", "max inside"
        stays = "mean stay, s", "max stay, s"
        rows = []
        for row in tables.zone_table(self.counts, self.settings.traffic.seconds):
            use = row.entered, row.left, row.mean, row.max, row.mean_stay, row.max_stay
            rows.append([*_interval(row), row.name, *use])
        return SheetTable([*_TIMES, *headings, *stays], rows)

    def _vehicles(self) -> SheetTable:
        """Return every passage of a vehicle at a line or zone."""
        headings = "clock", "time in the file", "file", "line or zone", "direction", "vehicle"
        measured = "class", "score", "seconds in the zone", "km/h", "mean km/h", "source"
        rows = list[list[Cell]]()
        for name, counts in self.videos.items():
            for event in counts.events:
                clock = counts.clock.at(event.time) if counts.clock else None
                passage = event.name, event.direction, event.vehicle, class_of(event)
                values = event.score, event.seconds, event.speed, event.mean_speed, event.source
                rows.append([clock, _time(event.time), name, *passage, *values])
        return SheetTable([*headings, *measured], rows).without_empty_columns()

    def files(self) -> SheetTable:
        """Return when each file was recorded, how that is known, and how one follows another."""
        rows, before = list[list[Cell]](), None
        for name, counts in self.videos.items():
            period = Intervals([(counts.clock, counts.spans)], None).periods[0]
            clock = counts.clock.source if counts.clock else "unknown"
            times = [_time(period.start), _time(period.end), period.observed]
            numbers = len(counts.events), len(counts.warnings)
            rows.append([name, *times, _seam(before, period), clock, *numbers])
            before = period
        headings = "file", "first frame", "last frame", "observed, s", "after the file before"
        return SheetTable([*headings, "clock", "events", "doubts"], rows)

    def checks(self) -> SheetTable:
        """Return what was checked in each file, and the estimate of the true numbers."""
        rows = list[list[Cell]]()
        for name, counts in self.videos.items():
            if corrected := counts.corrected:
                numbers = corrected.minutes, len(corrected.corrections)
                for item in corrected.estimates or [None]:
                    rows.append([name, ", ".join(corrected.files), *numbers, *_estimate(item)])
        headings = "file", "corrected by", "minutes checked", "events corrected"
        return SheetTable([*headings, *_ESTIMATE], rows, "Checks")

    def _corrections(self) -> SheetTable:
        """Return every correction."""
        headings = "file", "time in the file", *_DIRECTION, "class", "error", "correct"
        rows = list[list[Cell]]()
        for name, counts in self.videos.items():
            for item in counts.corrected.corrections if counts.corrected else ():
                time, *values = item.record.values()
                cells = (", ".join(v) or None if isinstance(v, list) else v for v in values)
                rows.append([name, _time(time), *cells])
        return SheetTable([*headings, "reviewer", "saved"], rows)

    def notes(self) -> SheetTable:
        """Return the findings of each file, and what the sheets mean."""
        rows: list[list[Cell]] = [
            [name, text]
            for name, counts in self.videos.items()
            for text in map(str, counts.findings)
        ]
        units = [f"{name} {number:g}" for name, number in self.settings.traffic.pcu.items()]
        rows += [["", text] for text in _NOTES.splitlines()]
        rows += [["", f"PCU: {', '.join(units)}; all other classes 1."]] if units else []
        return SheetTable(("file", "note"), rows)


def _nothing_found(counts: Counts) -> set[str]:
    """Return the note that no vehicle was found, if the file has it."""
    codes = {item.text: (item.code, item.severity) for item in counts.findings}
    return {text for text, code in codes.items() if code == ("nothing-found", "note")}


def _time(value: ClockTime) -> Cell:
    """Return a clock time, or seconds of a video, as a cell."""
    return timedelta(seconds=value) if isinstance(value, int | float) else value


def _interval(row: ZoneRow | Interval) -> list[Cell]:
    """Return the cells below `_TIMES`."""
    return [_time(row.start), _time(row.end), row.observed, "part" if row.is_part else None]


def _peak_hour(quarters: Tally[Key] | None, key: Key | None) -> list[Cell]:
    """Return the cells below `_PEAK`, which are empty if no hour is observed completely."""
    most, cells = 0, list[Cell]([None] * len(_PEAK))
    periods = quarters.intervals.periods if quarters else ()
    for hour in zip(periods, periods[1:], periods[2:], periods[3:], strict=False):
        numbers = [quarters.numbers[quarter.number, key, None] for quarter in hour if quarters]
        is_complete = hour[3].number - hour[0].number == 3 * QUARTER
        is_complete = is_complete and not any(quarter.is_part for quarter in hour)
        if is_complete and sum(numbers) > most:
            most = sum(numbers)
            cells = [_time(hour[0].start), most, round(most / (4 * max(numbers)), 2)]
    return cells


def _speeds(events: Iterable[GroupedEvent]) -> list[Cell]:
    """Return the cells below `_SPEEDS`."""
    speeds = [item.event.speed for item in events if item.event.speed is not None]
    quantiles: list[Cell] = np.quantile(speeds, [0.5, 0.85]).round(1).tolist() if speeds else []
    return quantiles or [None] * len(_SPEEDS)


def _estimate(item: Estimate | None) -> list[Cell]:
    """Return the cells below `_ESTIMATE`."""
    if item is None:
        return [None] * len(_ESTIMATE)
    names = item.group.name or _ALL, item.group.direction, item.group.class_name
    return [*names, item.counted, item.corrected, *_limits(item)]


def _limits(item: Estimate | None) -> list[Cell]:
    """Return the cells below `_ESTIMATED`."""
    return list(map(round, (item.true, item.low, item.high))) if item else [None] * 3


def _seam(before: Interval | None, file: Interval) -> str | None:
    """Return how a file follows another; None if it is the first, or a clock is unknown."""
    if not (before and isinstance(before.end, datetime) and isinstance(file.start, datetime)):
        return None
    gap = (file.start - before.end).total_seconds()
    if abs(gap) <= SEAM:
        return "continues"
    return f"gap of {gap:.0f} s" if gap > 0 else f"begins {-gap:.0f} s before its end"


def exits(lines: Iterable[LineSettings]) -> set[tuple[str, str]]:
    """Return the directions, with the names of the lines, that lead out of a junction.

    A vehicle leaves by an arm if it goes away from the middle of the lines of all arms.
    """
    arms = [line for line in lines if line.approach]
    ends = [(np.divide(arm.start, arm.size), np.divide(arm.end, arm.size)) for arm in arms]
    middle = np.mean(ends, axis=(0, 1)) if arms else None
    found = set()
    for arm, (start, end) in zip(arms, ends, strict=True):
        (x, y), (to_x, to_y) = end - start, middle - start
        side = x * to_y - y * to_x  # of the middle; y runs down, so right is positive
        if side:
            found.add((arm.name, arm.left if side > 0 else arm.right))
    return found


def movement(origin: Approach, destination: Approach) -> str:
    """Return how a vehicle goes from an arm of a junction to another: one of `MOVEMENTS`."""
    eighths = (APPROACHES.index(destination) - APPROACHES.index(origin)) % len(APPROACHES)
    left, through, right, u_turn = MOVEMENTS
    if eighths in (0, 4):
        return through if eighths else u_turn
    return left if eighths < 4 else right
