"""Events that a reviewer has judged, and which others are the same events."""

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from vdet.config.classes import UNKNOWN, standard_class
from vdet.config.scene import Name
from vdet.config.section import Section
from vdet.labels.label import NO_ID
from vdet.traffic.counts import Event

TOLERANCE = 0.5
"""Maximum seconds between two records of an event."""
_EXACT = 0.002
"""Seconds between two records of an event of one run."""
_DIFFERENCE = 0.01
"""Seconds that an event of another id or class counts as farther away."""
_ALONE = {"missed": 2.0, "false": 2.5}
"""What an event without a partner costs; others cost 3, a pair 1 and the seconds between both. So
pairs are as many as possible, known events come first, missed ones last.
"""

Error = Literal["false", "missed", "class", "direction"]
"""Nothing passed; something passed that was not counted; a wrong class; a wrong direction."""
Seconds = Annotated[float, Field(ge=-1e9, le=1e9)]


def _listed(value: Any) -> Any:
    """Return a list of one value where a file has only that; `false` without quotes is no text."""
    value = "false" if value is False else value
    return [value] if isinstance(value, str) else value or ()


class ReviewedEvent(Section):
    """An event as it was counted, or missed; its errors, and what is `correct`.

    `time` is in seconds in the video. `errors` is empty for what was counted rightly; class and
    direction may both be wrong. `correct` has the right value for each of these. `reviewer` and
    `saved` are those of the file, unless an event has its own.
    """

    name: Name = Field(alias="line")
    time: Seconds
    direction: Name
    class_name: Name = Field(UNKNOWN, alias="class")
    id: int = NO_ID
    errors: Annotated[tuple[Error, ...], BeforeValidator(_listed)] = Field((), alias="error")
    correct: Annotated[tuple[Name, ...], BeforeValidator(_listed)] = ()
    reviewer: str | None = None
    saved: datetime | None = None

    def __str__(self) -> str:
        return f"{self.name}, {self.time:.10g} s, {self.direction}, {self.class_name}"

    @model_validator(mode="after")
    def _says_what_is_correct(self) -> "ReviewedEvent":
        if len(self.errors) > 1 and {*self.errors} != {"class", "direction"}:
            raise ValueError("error: only class and direction can both be wrong")
        are_known = {*self.errors} <= {"class", "direction"}
        if len(self.correct) != len(self.errors) * are_known:
            raise ValueError("correct: is required for error: class and direction, and only there")
        return self

    @property
    def _correct(self) -> dict[str, str]:
        return dict(
            zip(self.errors, self.correct, strict=False)
        )  # nothing is correct of the others

    @property
    def true_direction(self) -> str:
        """The direction in which the vehicle passed."""
        return self._correct.get("direction", self.direction)

    @property
    def true_class(self) -> str:
        """The class of the vehicle that passed; ours for a synonym."""
        label = self._correct.get("class", self.class_name)
        return standard_class(label) or label

    @property
    def is_missed(self) -> bool:
        """Whether the vehicle passed, but was not counted."""
        return "missed" in self.errors

    @property
    def is_false(self) -> bool:
        """Whether it was counted, but no vehicle passed."""
        return "false" in self.errors

    @property
    def truth(self) -> tuple[str, str] | None:
        """Direction and class of the vehicle that passed; None: none did."""
        return None if self.is_false else (self.true_direction, self.true_class)


E = TypeVar("E", bound=ReviewedEvent | Event)


def paired(
    reviewed: Sequence[ReviewedEvent], events: Sequence[E]
) -> list[tuple[ReviewedEvent | None, E | None]]:
    """Return each reviewed event with the event that is the same one; None: there is none.

    Both are at one line, in one direction (as counted or as it is right), and within `TOLERANCE`.
    The assignment is optimal: Jonker and Volgenant, "A Shortest Augmenting Path Algorithm for Dense
    and Sparse Linear Assignment Problems", 1987. Events alone come at the end, with None.
    """
    from scipy.sparse import csr_array  # most runs load nothing of it
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    lines: dict[str, list[int]] = {}
    for number in sorted(range(len(events)), key=lambda number: events[number].time):
        lines.setdefault(events[number].name, []).append(number)
    times = {name: np.array([events[n].time for n in line]) for name, line in lines.items()}
    edges: list[tuple[int, int, float]] = []
    for row, review in enumerate(reviewed):
        cost = min((_ALONE.get(error, 3.0) for error in review.errors), default=3.0)
        edges.append((row, len(events) + row, cost))
        if line := lines.get(review.name):
            reach = (review.time - TOLERANCE, review.time + TOLERANCE)
            first, end = np.searchsorted(times[review.name], reach).tolist()
            for column in line[first:end]:
                if not _ways(review).isdisjoint(_ways(events[column])):
                    edges.append((row, column, _cost(review, events[column])))  # noqa: PERF401
    partners: dict[int, int] = {}
    if edges:
        rows, columns, costs = map(np.array, zip(*edges, strict=True))
        shape = len(reviewed), len(events) + len(reviewed)
        matching = min_weight_full_bipartite_matching(csr_array((costs, (rows, columns)), shape))
        partners = dict(zip(*(part.tolist() for part in matching), strict=True))
    pairs: list[tuple[ReviewedEvent | None, E | None]] = []
    for row, review in enumerate(reviewed):
        column = partners[row]
        pairs.append((review, events[column] if column < len(events) else None))
    alone = sorted({*range(len(events))} - {*partners.values()})
    return [*pairs, *((None, events[number]) for number in alone)]


def _ways(event: ReviewedEvent | Event) -> set[str]:
    if isinstance(event, ReviewedEvent):
        return {event.direction, event.true_direction}
    return {event.direction}


def _cost(review: ReviewedEvent, event: ReviewedEvent | Event) -> float:
    seconds, is_same_id = abs(review.time - event.time), review.id == event.id != NO_ID
    if is_same_id and seconds <= _EXACT:
        return _EXACT + seconds  # it is of the run that was reviewed
    is_same_class = event.class_name in (review.class_name, review.true_class)
    return 1 + seconds + _DIFFERENCE * ((not is_same_id) + (not is_same_class))
