"""Accuracy of counts at lines, by direction and class, where a reviewer has checked them."""

import csv
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, TypeAdapter, ValidationError

from vdet.config.classes import UNKNOWN
from vdet.errors import TruthError
from vdet.evaluate.output import figure, table
from vdet.traffic.corrections import Passage, paired
from vdet.traffic.counts import Checked

ALL = "all"
"""Name of the sum over lines, directions or classes."""


class _Row(BaseModel):
    time: float
    name: str
    direction: str
    id: int
    class_name: str | None = Field(None, alias="class")


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

    def percent(self, number: int) -> float | None:
        """Return a number as a percentage of the vehicles that passed; None if none did."""
        return round(100 * number / self.passed, 1) if self.passed else None

    @property
    def record(self) -> dict[str, Any]:
        """The values for JSON."""
        right = self.passed - self.missed - self.misnamed
        return asdict(self) | {
            "counted_percent": self.percent(self.counted),
            "right_percent": self.percent(right),
        }


def score_counts(path: Path, truth: Path) -> list[CountScore]:
    """Compare a table of events with corrected counts, in the parts that were checked.

    Parameters
    ----------
    path
        Events that `--counts` wrote, `.csv` or `.json`.
    truth
        Corrected counts, `.json`.

    Raises
    ------
    TruthError
        A file cannot be used, or nothing was checked.
    """
    content = _json(truth)
    checked_items = (content.get("corrected") or {}).get("checked", [])
    checked = _parsed(truth, list[Checked], checked_items)
    if not checked:
        raise TruthError(
            f"{truth}: has no counts that were corrected and checked; write it with vdet count "
            "--corrections FILE --counts FILE.json"
        )
    real = _passages(truth, content.get("events"))
    events = _csv(path) if path.suffix.lower() == ".csv" else _json(path).get("events")
    return list(_scores(_passages(path, events), real, checked))


def _csv(path: Path) -> list[dict[str, str]]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    except (OSError, ValueError, csv.Error) as error:
        raise TruthError(f"{path}: is not a table of vdet count --counts: {error}") from error


def _json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise TruthError(f"{path}: is not JSON of vdet count --counts: {error}") from error
    return content if isinstance(content, dict) else {}


def _parsed(path: Path, kind: Any, values: Any) -> Any:
    try:
        return TypeAdapter(kind).validate_python(values)
    except ValidationError as error:
        mistake = error.errors()[0]
        place = ".".join(map(str, mistake["loc"]))
        raise TruthError(
            f"{path}: is not a table of events of one video: {place}: {mistake['msg']}"
        ) from error


def _passages(path: Path, events: Any) -> list[Passage]:
    rows: list[_Row] = _parsed(path, list[_Row], events)
    return [
        Passage(row.time, row.name, row.direction, row.class_name or UNKNOWN, row.id)
        for row in rows
    ]


@dataclass(frozen=True, slots=True)
class _Pair:
    """A vehicle that passed, and what was counted; None: missed, or false."""

    real: Passage | None
    counted: Passage | None

    @property
    def one(self) -> Passage:
        one = self.real or self.counted
        assert one is not None
        return one


def _scores(
    counted: Sequence[Passage], real: Sequence[Passage], checked: Sequence[Checked]
) -> Iterator[CountScore]:
    """Yield the score of each direction and class, of each direction, and of all."""
    numbers = paired(real, counted)
    pairs = [
        _Pair(one, counted[numbers[n]] if n in numbers else None) for n, one in enumerate(real)
    ]
    taken = set(numbers.values())
    pairs += [_Pair(None, one) for n, one in enumerate(counted) if n not in taken]
    pairs = [pair for pair in pairs if _is_checked(pair.one, checked)]
    ways = sorted({(pair.one.name, pair.one.direction) for pair in pairs})
    for way in ways:
        own = [pair for pair in pairs if (pair.one.name, pair.one.direction) == way]
        sides = [side for pair in own for side in (pair.real, pair.counted) if side]
        for kind in sorted({side.class_name for side in sides}):
            yield _score(own, *way, kind)
        yield _score(own, *way, ALL)
    yield _score(pairs, ALL, ALL, ALL)


def _is_checked(one: Passage, checked: Sequence[Checked]) -> bool:
    return any(span.line == one.name and span.start <= one.time < span.end for span in checked)


def _score(pairs: Sequence[_Pair], name: str, direction: str, kind: str) -> CountScore:
    def is_kind(one: Passage | None) -> bool:
        return one is not None and kind in (ALL, one.class_name)

    real = [pair for pair in pairs if is_kind(pair.real)]
    counted = [pair for pair in pairs if is_kind(pair.counted)]
    return CountScore(
        name=name,
        direction=direction,
        class_name=kind,
        passed=len(real),
        counted=len(counted),
        missed=sum(pair.counted is None for pair in real),
        false=sum(pair.real is None for pair in counted),
        misnamed=sum(
            bool(pair.real and pair.counted and pair.real.class_name != pair.counted.class_name)
            for pair in real
        ),
    )


def count_lines(scores: Sequence[CountScore]) -> list[str]:
    """Return the scores as a table of text."""
    headings = (
        *("line", "direction", "class", "passed", "counted", "missed", "false", "wrong class"),
        *("counted %", "right %"),
    )
    rows = []
    for score in scores:
        *names, counted, right = score.record.values()
        rows.append([*map(str, names), figure(counted, 1), figure(right, 1)])
    return table(headings, rows)
