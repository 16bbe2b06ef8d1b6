"""Accuracy of counts at lines, by direction and class, where a reviewer has checked them."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vdet.config.classes import UNKNOWN
from vdet.config.loading import Document, validated
from vdet.errors import TruthError
from vdet.evaluate.results import figure, table
from vdet.review.corrections import Corrections, ReviewedEvent, judge
from vdet.traffic.counts import Counts, Event, class_of
from vdet.traffic.output import VIDEO, read_table

_COLUMNS = "time", "name", "direction", "class", "id"
ALL = "all"
"""Name of the sum over lines, directions or classes."""


@dataclass(slots=True)
class CountScore:
    """How right the counts in a direction are for a class, or for all.

    Attributes
    ----------
    passed, counted
        Number of vehicles that passed, and that were counted.
    missed, false
        Number of vehicles that passed and were not counted, and of counts without a vehicle.
    misnamed
        Number of vehicles that passed and were counted as another class.
    """

    name: str
    direction: str
    class_name: str
    passed: int = 0
    counted: int = 0
    missed: int = 0
    false: int = 0
    misnamed: int = 0

    def order(self) -> tuple[Any, ...]:
        """Return a key that sorts by line, direction and class; sums come last."""
        return tuple((name == ALL, name) for name in (self.name, self.direction, self.class_name))

    def add(self, passed: Event | None, counted: Event | None) -> None:
        """Add a vehicle that passed, as it was counted; None: it did not, or was not."""
        is_passed, is_counted = (
            event is not None and self.class_name in (ALL, class_of(event))
            for event in (passed, counted)
        )
        self.passed += is_passed
        self.counted += is_counted
        self.missed += is_passed and not counted
        self.false += is_counted and not passed
        if is_passed and passed and counted:
            self.misnamed += class_of(passed) != class_of(counted)

    @property
    def record(self) -> dict[str, Any]:
        """The values for tables and JSON, with percentages of the vehicles that passed."""
        right = self.passed - self.missed - self.misnamed
        numbers = {"counted_percent": self.counted, "right_percent": right}
        percents = {
            name: round(100 * number / self.passed, 1) if self.passed else None
            for name, number in numbers.items()
        }
        return asdict(self) | percents


def score_counts(path: Path, truth: Corrections) -> list[CountScore]:
    """Compare a table of events, `.csv`, with corrections, in the parts that were checked.

    Returns
    -------
    The score of each direction and class, of each direction, and of all.

    Raises
    ------
    TruthError
        The table cannot be read, or nothing was checked.
    ConfigError
        The table has another form.
    """
    if not truth.checked:
        raise TruthError(f"{truth.source}: nothing was checked; check some minutes in the page")
    checked = tuple(span.model_copy(update={"complete": True}) for span in truth.checked)
    truth = truth.model_copy(update={"checked": checked})
    zones = tuple(zone.name for zone in truth.zones)
    counts = Counts(_read_events(path), (), zones, spans=((-math.inf, math.inf),))
    scores: dict[tuple[str, str, str], CountScore] = {}
    for item in judge(counts, truth):
        sides = [(item.right, item.counted)]
        if item.right and item.counted and item.right.direction != item.counted.direction:
            sides = [(item.right, None), (None, item.counted)]
        for passed, counted in sides:
            event = passed or counted
            if event and truth.lists(event):
                classes = {ALL, *(class_of(side) for side in (passed, counted) if side)}
                keys = {(event.name, event.direction, class_name) for class_name in classes}
                for key in (*keys, (ALL, ALL, ALL)):
                    scores.setdefault(key, CountScore(*key)).add(passed, counted)
    return sorted(scores.values(), key=CountScore.order)


def _read_events(path: Path) -> tuple[Event, ...]:
    rows, events = read_table(path, _COLUMNS), list[Event]()
    if rows and VIDEO in rows[0]:
        raise TruthError(f"{path}: has several videos; count each on its own")
    for line, row in enumerate(rows, start=2):
        values: dict[str, Any] = {name: row[name] for name in ("time", "direction", "id")}
        values |= {"line": row["name"], "class": row["class"] or UNKNOWN}
        row_event = validated(ReviewedEvent, Document(f"{path}:{line}", values))
        name, way, number = row_event.name, row_event.direction, row_event.id
        events.append(
            Event(row_event.time, 0, name, way, number, number, row_event.true_class, 1.0)
        )
    return tuple(events)


def count_lines(scores: Sequence[CountScore]) -> list[str]:
    """Return the scores as a table of text."""
    headings = [name.replace("_", " ") for name in scores[0].record]
    rows = [[figure(value, 1) for value in score.record.values()] for score in scores]
    return table(headings, rows)
