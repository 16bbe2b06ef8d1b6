"""Corrections: what reviewers say of counted events, read from files and applied to counts."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, PrivateAttr, model_validator

from vdet.config.classes import UNKNOWN, is_chosen, standard_class
from vdet.config.document import read_document
from vdet.config.loading import validated
from vdet.config.section import Section
from vdet.config.shapes import LineSettings, Name, Shape, Size, TrafficSettings, ZoneSettings
from vdet.errors import ConfigError
from vdet.labels.label import NO_ID
from vdet.traffic.counts import Corrected, Counts, Event, class_of
from vdet.traffic.estimate import CountError, Estimate, estimate

MAX_BYTES = 5_000_000
"""Size of a file of some 50,000 events."""
_MINUTE = 60.0
"""Seconds of the parts of a video that are checked at a time."""
TOLERANCE = 0.5
"""Maximum seconds between two records of an event."""
_DIFFERENCE = 0.01
"""Seconds that an event of another id or class counts as farther away."""
_LAST = 1.0
"""Seconds that an event which a reviewer added counts as farther away: more than `TOLERANCE`."""
_PIXELS = 1.0
"""Maximum distance between the points of the same line, pixels of the review."""
NO_FRAME = -1
"""`Event.frame` of a vehicle that a reviewer added."""

Error = Literal["false", "missed", "class", "direction"]
"""Nothing passed; something passed that was not counted; a wrong class; a wrong direction."""


def _listed(value: Any) -> Any:
    """Return a list of one value where a file has only that; `false` without quotes is no text."""
    value = "false" if value is False else value
    return [value] if isinstance(value, str) else value or ()


class ReviewedEvent(Section):
    """An event as it was counted, or missed; its errors, and what is `correct`.

    `time` is in seconds in the video. `errors` is empty for what was counted rightly; class and
    direction may both be wrong. `correct` has the right value for each of these.
    """

    name: Name = Field(alias="line")
    time: float
    direction: Name
    class_name: Name = Field(UNKNOWN, alias="class")
    id: int = NO_ID
    errors: Annotated[tuple[Error, ...], BeforeValidator(_listed)] = Field((), alias="error")
    correct: Annotated[tuple[Name, ...], BeforeValidator(_listed)] = ()

    def __str__(self) -> str:
        return f"{self.name}, {self.time:g} s, {self.direction}, {self.class_name}"

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

    def corrected(self, event: Event | None) -> Event | None:
        """Return the event as it should have been counted; None: it should not, or was not."""
        if self.is_missed:
            event = event or Event(
                time=self.time,
                frame=NO_FRAME,
                name=self.name,
                direction=self.direction,
                id=NO_ID,
                vehicle=NO_ID,
                class_name=self.true_class,
                score=1.0,
            )
        if event is None or self.is_false:
            return None
        class_name = self.true_class if {"class", "missed"} & {*self.errors} else event.class_name
        return replace(event, direction=self.true_direction, class_name=class_name)

    @property
    def opinion(self) -> tuple[str, ...]:
        """What two reviewers must agree on."""
        return *self.errors, self.true_direction, self.true_class


class CheckedSpan(Section):
    """A part of the video that was checked at a line or zone; seconds in the video."""

    line: Name
    start: float
    end: float


class Sample(Section):
    """The minutes of the video that were drawn to be checked, from 0, and the seed."""

    seed: int
    minutes: tuple[int, ...] = ()


E = TypeVar("E", bound=ReviewedEvent | Event)
C = TypeVar("C", bound=ReviewedEvent | Event)


def paired(events: Sequence[E], candidates: Sequence[C]) -> list[tuple[E | None, C | None]]:
    """Return each event with the candidate that is the same event; None: there is none.

    Both are at the same line, in the same direction, and within `TOLERANCE`. The nearest are paired
    first, missed vehicles last. Candidates without an event come at the end, with None.
    """
    order = sorted(range(len(candidates)), key=lambda number: candidates[number].time)
    times = [candidates[number].time for number in order]
    near = []
    for number, event in enumerate(events):
        first = bisect_left(times, event.time - TOLERANCE)
        end = bisect_right(times, event.time + TOLERANCE)
        near += [(_distance(event, candidates[n]), number, n) for n in order[first:end]]
    partners: dict[int, C] = {}
    alone = dict(enumerate(candidates))
    for distance, number, candidate in sorted(near):
        if distance < math.inf and number not in partners and candidate in alone:
            partners[number] = alone.pop(candidate)
    pairs = [(event, partners.get(number)) for number, event in enumerate(events)]
    return [*pairs, *((None, candidate) for candidate in alone.values())]


def _distance(first: ReviewedEvent | Event, second: ReviewedEvent | Event) -> float:
    """Return the seconds between two events, more if their id or class differs."""
    if (first.name, first.direction) != (second.name, second.direction):
        return math.inf
    is_missed = NO_ID in (first.id, second.id)
    differences = (first.id != second.id) + (first.class_name != second.class_name)
    return abs(first.time - second.time) + _DIFFERENCE * differences + _LAST * is_missed


class Corrections(Section):
    """What a reviewer says of the counts of a video, or several whose files were merged."""

    video: str
    """Name of the video."""
    size: Size
    """Width and height of the frames that the points refer to."""
    start: float = 0.0
    """Of 1.1.0: the time of the first frame, seconds, which `read` takes off all times."""
    lines: tuple[LineSettings, ...] = ()
    zones: tuple[ZoneSettings, ...] = ()
    reviewer: str | None = None
    saved: datetime | None = None
    sample: Sample | None = None
    checked: tuple[CheckedSpan, ...] = ()
    events: tuple[ReviewedEvent, ...] = ()
    """All errors, and what was counted rightly in the checked parts and near all errors."""
    _files: tuple[str, ...] = PrivateAttr(("corrections",))

    @model_validator(mode="after")
    def _fit_together(self) -> "Corrections":
        directions = self.traffic.directions
        for span in self.checked:
            if span.line not in directions:
                raise ValueError(f"checked: there is no line or zone {span.line}")
        for event in self.events:
            for direction in (event.direction, event.true_direction):
                if direction not in directions.get(event.name, ()):
                    raise ValueError(f"events: {event.name} has no direction {direction}")
        return self

    @staticmethod
    def read(path: Path) -> "Corrections":
        """Read a file. Raises `ConfigError`, with the position of each mistake."""
        document = read_document(path, limit=MAX_BYTES, what="file of corrections")
        corrections = validated(Corrections, document)
        if start := corrections.start:
            events = [e.model_copy(update={"time": e.time - start}) for e in corrections.events]
            spans = [
                span.model_copy(update={"start": span.start - start, "end": span.end - start})
                for span in corrections.checked
            ]
            update = {"start": 0.0, "events": tuple(events), "checked": tuple(spans)}
            corrections = corrections.model_copy(update=update)
        corrections._files = (str(path),)
        return corrections

    @property
    def source(self) -> str:
        """The files, for messages."""
        return ", ".join(self._files)

    @property
    def traffic(self) -> TrafficSettings:
        """The lines and zones, with the size of their frames."""
        update = {"size": self.size}
        return TrafficSettings(
            lines=tuple(line.model_copy(update=update) for line in self.lines),
            zones=tuple(zone.model_copy(update=update) for zone in self.zones),
        )

    def check(self, traffic: TrafficSettings) -> None:
        """Raise `ConfigError` if the lines and zones are not among those of the settings."""
        try:
            shapes = traffic.for_frames(*self.size).shapes
        except ConfigError as error:
            raise ConfigError(f"{self.source}: {str(error).removeprefix('camera.')}") from error
        for reviewed in self.traffic.shapes:
            if not any(_is_same(reviewed, shape) for shape in shapes):
                raise ConfigError(
                    f"{self.source}: {reviewed.name} is not where these settings have it; count "
                    "with the settings of the review"
                )

    def merged(self, review: "Corrections") -> "Corrections":
        """Return the corrections of two reviewers of one video.

        Raises
        ------
        ConfigError
            They are for different lines, or contradict each other: they correct an event in
            different ways, or only one corrects it, and both have checked it.
        """
        review.check(self.traffic)
        pairs = paired(self.events, review.events)
        added = [second for first, second in pairs if second and not first]
        alone = [first for first, second in pairs if first and not second]
        disputed = [a for a, b in pairs if a and b and a.opinion != b.opinion]
        disputed += [event for event in alone if event.errors and review.has_checked(event)]
        disputed += [event for event in added if event.errors and self.has_checked(event)]
        if disputed:
            raise ConfigError(
                f"{self.source} and {review.source}: contradict each other: {disputed[0]}; "
                "correct one of them"
            )
        samples = [review.sample for review in (self, review) if review.sample]
        update = {
            "events": (*self.events, *added),
            "checked": self.checked + review.checked,
            "sample": max(samples, key=lambda sample: len(sample.minutes), default=None),
        }
        result = self.model_copy(update=update)
        result._files = self._files + review._files
        return result

    def has_checked(self, event: ReviewedEvent | Event) -> bool:
        """Return whether the line was checked at the time of an event."""
        return event.name in self.lines_checked_at(event.time)

    def lines_checked_at(self, time: float) -> set[str]:
        """Return the lines and zones that were checked at this time, seconds in the video."""
        return {span.line for span in self.checked if span.start <= time < span.end}

    def minute(self, time: float) -> int:
        """Return the number of the minute of a time, seconds in the video."""
        return int(time // _MINUTE)

    @property
    def checked_lines(self) -> set[str]:
        """The lines and zones that were checked, at least in a part of the video."""
        return {span.line for span in self.checked}

    def passed(self) -> list[ReviewedEvent]:
        """Return what passed: the events as they should have been counted."""
        classes = {event.id: event.true_class for event in self.events if "class" in event.errors}
        classes.pop(NO_ID, None)
        passed = []
        for event in (event for event in self.events if not event.is_false):
            true_class = classes.get(event.id, event.true_class)
            update = {"direction": event.true_direction, "class_name": true_class}
            passed.append(event.model_copy(update=update))
        return passed

    def paired_with(
        self, events: Sequence[Event]
    ) -> list[tuple[ReviewedEvent | None, Event | None]]:
        """Return its events, each with the counted event that it is about.

        A missed vehicle may have been counted by another run: as an event that the reviewer says
        nothing of.

        Raises
        ------
        ConfigError
            An error fits no event.
        """
        pairs = paired(self.events, events)
        for review, event in pairs:
            if review and not event and review.errors and not review.is_missed:
                raise ConfigError(
                    f"{self.source}: {review}: no such event was counted within {TOLERANCE} s; "
                    "remove this correction, or check these counts anew"
                )
        return pairs

    def apply(self, counts: Counts, chosen: Collection[str] = ()) -> Counts:
        """Return corrected counts, as `apply_corrections` does for several videos."""
        return apply_corrections({"": counts}, {"": self}, chosen)[""]


def read_corrections(paths: Iterable[Path]) -> list[Corrections]:
    """Read files, and merge those of each video. Errors as in `Corrections`."""
    reviews: dict[str, Corrections] = {}
    for review in map(Corrections.read, paths):
        before = reviews.get(review.video)
        reviews[review.video] = before.merged(review) if before else review
    return list(reviews.values())


def by_video(
    corrections: Iterable[Corrections], videos: Mapping[str, str | None], traffic: TrafficSettings
) -> dict[str, Corrections]:
    """Return the corrections of videos by their keys.

    `videos` has the name of each by its key; None if unknown. Raises `ConfigError` if corrections
    are not for exactly one of them, or for other lines than those of `traffic`.
    """
    result: dict[str, Corrections] = {}
    for review in corrections:
        keys = [key for key, name in videos.items() if name == review.video]
        keys = keys or [key for key, name in videos.items() if name is None]
        if len(keys) != 1 or keys[0] in result:
            names = ", ".join(name or key for key, name in videos.items())
            raise ConfigError(
                f"{review.source}: corrects {review.video}, which must be exactly one of these "
                f"videos: {names}"
            )
        review.check(traffic)
        result[keys[0]] = review
    return result


def apply_corrections(
    videos: Mapping[str, Counts],
    corrections: Mapping[str, Corrections],
    chosen: Collection[str] = (),
) -> dict[str, Counts]:
    """Return the counts of videos, corrected where there are corrections with the same key.

    An event is removed, added, or gets another direction. A vehicle gets another class in all its
    events, also in other videos. Only the `chosen` classes are kept; if empty, all. Raises
    `ConfigError` if a correction fits no event, or a vehicle has two classes.
    """
    numbers = [event.vehicle for counts in videos.values() for event in counts.events]
    new_vehicles = count(max(numbers, default=0) + 1)
    classes: dict[int, str] = {}
    corrected = dict(videos)
    for key, review in corrections.items():
        corrected[key] = _corrected(videos[key], review, classes)
    for key, counts in corrected.items():
        events = []
        for event in counts.events:
            vehicle = next(new_vehicles) if event.vehicle == NO_ID else event.vehicle
            class_name = classes.get(vehicle, event.class_name)
            if is_chosen(class_name, chosen):
                events.append(replace(event, vehicle=vehicle, class_name=class_name))
        corrected[key] = replace(counts, events=tuple(events))
    return corrected


def _corrected(counts: Counts, review: Corrections, classes: dict[int, str]) -> Counts:
    """Return counts with the right events, and add the right classes of vehicles to `classes`."""
    events, changes = list[Event](), 0
    pairs = review.paired_with(counts.events)
    for reviewed, event in pairs:
        right_event = reviewed.corrected(event) if reviewed else event
        changes += right_event != event
        if right_event:
            events.append(right_event)
        if reviewed and event and {"class", "missed"} & {*reviewed.errors}:
            true_class = classes.setdefault(event.vehicle, reviewed.true_class)
            if true_class != reviewed.true_class:
                raise ConfigError(
                    f"{review.source}: {reviewed}: the same vehicle is a {true_class} in another "
                    "correction; remove one"
                )
    events.sort(key=lambda event: (event.time, event.frame, event.id, event.name))
    files = tuple(Path(name).name for name in review._files)
    minutes, checked = _minutes(counts, review), _checked_minutes(counts, review)
    estimates = _estimates(counts, review, pairs)
    corrected = Corrected(changes, files, len(checked), len(minutes), estimates)
    return replace(counts, events=tuple(events), corrected=corrected)


def _minutes(counts: Counts, review: Corrections) -> list[int]:
    """Return the minutes with video."""
    spans = ((review.minute(first), review.minute(last)) for first, last in counts.spans)
    minutes = {minute for first, last in spans for minute in range(first, last + 1)}
    return sorted(minutes.union(review.minute(event.time) for event in counts.events))


def _checked_minutes(counts: Counts, review: Corrections) -> list[int]:
    """Return the minutes that were checked at all lines which were checked at any time."""
    lines, start = review.checked_lines, TOLERANCE
    return [
        minute
        for minute in _minutes(counts, review)
        if lines and review.lines_checked_at(start + _MINUTE * minute) == lines
    ]


def _estimates(
    counts: Counts,
    review: Corrections,
    pairs: Sequence[tuple[ReviewedEvent | None, Event | None]],
) -> tuple[Estimate, ...]:
    """Return the true number of events at the checked lines, as the page of the review does."""
    numbers = {minute: number for number, minute in enumerate(_minutes(counts, review))}
    checked = _checked_minutes(counts, review)
    events = [event for event in counts.events if event.name in review.checked_lines]
    classes = {class_of(event) for event in events} or {UNKNOWN}
    counted = {name: [0] * len(numbers) for name in classes}
    for event in events:
        counted[class_of(event)][numbers[review.minute(event.time)]] += 1
    errors = [
        CountError(
            minute=numbers[minute],
            counted=class_of(event) if event else None,
            true=None if reviewed.is_false else reviewed.true_class,
        )
        for reviewed, event in pairs
        if reviewed and reviewed.errors and (minute := review.minute(reviewed.time)) in checked
    ]
    sample = review.sample.minutes if review.sample else ()
    drawn = [numbers[minute] for minute in sample if minute in numbers]
    return tuple(estimate(counted, errors, [numbers[minute] for minute in checked], drawn))


def _is_same(first: Shape, second: Shape) -> bool:
    """Return whether two lines or zones have the same name, directions and points."""
    names, points = [], []
    for shape in (first, second):
        names.append(shape.model_dump(include={"name", "left", "right"}))
        points.append(np.vstack([getattr(shape, field) for field in shape.point_fields]))
    is_same = names[0] == names[1] and points[0].shape == points[1].shape
    return is_same and bool(np.hypot(*(points[0] - points[1]).T).max() <= _PIXELS)
