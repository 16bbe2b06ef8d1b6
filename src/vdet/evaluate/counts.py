"""Accuracy of counts at lines, by direction and class, where a reviewer has checked them."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vdet.config.classes import UNKNOWN
from vdet.config.document import Document
from vdet.config.loading import validated
from vdet.errors import TruthError
from vdet.evaluate.output import figure, table
from vdet.traffic.corrections import Corrections, ReviewedEvent, paired
from vdet.traffic.tables import VIDEO, read_csv

ALL = "all"
"""Name of the sum over lines, directions or classes."""


@dataclass(frozen=True, slots=True)
class CountScore:
    """How right the counts in a direction are for one class of true vehicles, or for all.

    Attributes
    ----------
    passed, counted
        Number of vehicles that passed, and that were counted.
    missed, false
        Those that passed and were not counted, and the reverse.
    misnamed
        Those that passed, and were counted as another class.
    """

    name: str
    direction: str
    class_name: str
    passed: int
    counted: int
    missed: int
    false: int
    misnamed: int

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
    outcomes = []
    for passed, counted in paired(truth.passed(), _read_events(path)):
        event = passed or counted
        if event and truth.has_checked(event):
            outcome = _Outcome(
                name=event.name,
                direction=event.direction,
                passed=passed.class_name if passed else None,
                counted=counted.class_name if counted else None,
            )
            outcomes.append(outcome)
    scores = []
    for name, direction in sorted({(outcome.name, outcome.direction) for outcome in outcomes}):
        members = [o for o in outcomes if (o.name, o.direction) == (name, direction)]
        labels = {label for o in members for label in (o.passed, o.counted) if label}
        scores += [_score(members, name, direction, label) for label in (*sorted(labels), ALL)]
    return [*scores, _score(outcomes, ALL, ALL, ALL)]


def _read_events(path: Path) -> list[ReviewedEvent]:
    rows = read_csv(path)
    if rows and VIDEO in rows[0]:
        raise TruthError(f"{path}: has several videos; write a table for each")
    events = []
    for line, row in enumerate(rows, start=2):
        values = {name: row.get(name) for name in ("time", "direction", "id")}
        values |= {"line": row.get("name"), "class": row.get("class") or UNKNOWN}
        events.append(validated(ReviewedEvent, Document(f"{path}:{line}", values)))
    return events


@dataclass(frozen=True, slots=True)
class _Outcome:
    """A vehicle at a line or zone: the class that passed, and the one that was counted.

    None: nothing passed, or nothing was counted.
    """

    name: str
    direction: str
    passed: str | None
    counted: str | None


def _score(outcomes: Sequence[_Outcome], name: str, direction: str, label: str) -> CountScore:
    passed = [o for o in outcomes if o.passed and label in (ALL, o.passed)]
    counted = [o for o in outcomes if o.counted and label in (ALL, o.counted)]
    return CountScore(
        name=name,
        direction=direction,
        class_name=label,
        passed=len(passed),
        counted=len(counted),
        missed=sum(outcome.counted is None for outcome in passed),
        false=sum(outcome.passed is None for outcome in counted),
        misnamed=sum(outcome.counted not in (None, outcome.passed) for outcome in passed),
    )


def count_lines(scores: Sequence[CountScore]) -> list[str]:
    """Return the scores as a table of text."""
    headings = [name.replace("_", " ") for name in scores[0].record]
    rows = [[figure(value, 1) for value in score.record.values()] for score in scores]
    return table(headings, rows)
