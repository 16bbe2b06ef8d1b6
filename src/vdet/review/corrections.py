"""Corrections: what reviewers say of the counts of a video, and the counts as they are right."""

import json
from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from itertools import chain, count, pairwise
from math import inf
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import numpy as np
from pydantic import AwareDatetime, BeforeValidator, Field, PrivateAttr, model_validator

from vdet.config.classes import UNKNOWN, is_chosen, standard_class
from vdet.config.loading import MAX_MISTAKES, Document, read_document, validated
from vdet.config.scene import LineSettings, Name, Shape, Size, TrafficSettings, ZoneSettings
from vdet.config.schema import Settings
from vdet.config.section import Section
from vdet.errors import ConfigError
from vdet.files import read_whole
from vdet.findings import Finding
from vdet.labels.label import NO_ID, SourceVideo, may_be_same
from vdet.review.estimate import equal_spans, estimate
from vdet.traffic.clock import Span
from vdet.traffic.counts import (
    ALL,
    Corrected,
    Correction,
    Counts,
    Direction,
    Estimate,
    Event,
    VehicleGroup,
    class_of,
    unbalanced_zones,
)
from vdet.traffic.crossings import APPEAR, ENTER, VANISH

MAX_BYTES = 5_000_000
"""Size of a file of some 50,000 events."""
MAX_A_SECOND = 200
"""Maximum number of events at a line within a second."""
_PIXELS = 1.0
"""Maximum distance between the points of the same line, pixels of the review."""
_SECONDS = timedelta(seconds=1)
"""Maximum difference between the lengths, and between the beginnings, of the same video."""
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

_IMBALANCE = "{}: after corrections, more vehicles enter than leave, or fewer; occupancy is unknown"
_BEYOND = "no estimate: more of the video was counted than was reviewed; review all of it"
NO_FRAME = -1
"""`Event.frame` of a vehicle that a reviewer added."""

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
        return dict(zip(self.errors, self.correct, strict=False))  # missed, false: nothing is

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
    def truth(self) -> tuple[str, str] | None:
        """Direction and class of the vehicle that passed; None: none did."""
        return None if "false" in self.errors else (self.true_direction, self.true_class)


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

    if not reviewed:
        return [(None, event) for event in events]
    lines = defaultdict[str, list[int]](list)
    for number in sorted(range(len(events)), key=lambda number: events[number].time):
        lines[events[number].name].append(number)
    edges: list[tuple[int, int, float]] = []
    for row, review in enumerate(reviewed):
        cost = min((_ALONE.get(error, 3.0) for error in review.errors), default=3.0)
        edges.append((row, len(events) + row, cost))
        line, time = lines[review.name], review.time
        first = bisect_left(line, time - TOLERANCE, key=lambda number: events[number].time)
        end = bisect_right(line, time + TOLERANCE, key=lambda number: events[number].time)
        near = ((number, events[number]) for number in line[first:end])
        edges += [(row, n, _cost(review, e)) for n, e in near if _ways(review) & _ways(e)]
    rows, columns, costs = map(np.array, zip(*edges, strict=True))
    shape = len(reviewed), len(events) + len(reviewed)
    matching = min_weight_full_bipartite_matching(csr_array((costs, (rows, columns)), shape))
    partners = [column for _, column in sorted(zip(*map(np.ndarray.tolist, matching), strict=True))]
    alone = sorted({*range(len(events))} - {*partners})
    found = [events[column] if column < len(events) else None for column in partners]
    return [*zip(reviewed, found, strict=True), *((None, events[number]) for number in alone)]


def _ways(event: ReviewedEvent | Event) -> set[str]:
    return {event.direction, getattr(event, "true_direction", event.direction)}


def _cost(review: ReviewedEvent, event: ReviewedEvent | Event) -> float:
    seconds, is_same_id = abs(review.time - event.time), review.id == event.id != NO_ID
    if is_same_id and seconds <= _EXACT:
        return _EXACT + seconds  # it is of the run that was reviewed
    is_same_class = event.class_name in (review.class_name, review.true_class)
    return 1 + seconds + _DIFFERENCE * ((not is_same_id) + (not is_same_class))


class CheckedSpan(Section):
    """A part of the video that was checked at a line or zone; seconds in the video.

    It is `complete` if the events in it are all that passed.
    """

    line: Name
    start: Seconds
    end: Seconds
    complete: bool = False


class Sample(Section):
    """The spans of the video that were drawn to be checked, from 0, and the seed."""

    renamed: ClassVar[Mapping[str, str]] = {"minutes": "spans"}

    seed: int
    spans: tuple[int, ...] = ()


class Corrections(Section):
    """What a reviewer says of the counts of a video, or several whose files were merged."""

    video: str
    """Path of the video, or its last parts."""
    size: Size
    """Width and height of the frames that the points refer to."""
    length: float | None = None
    """Duration of the video, seconds."""
    begin: AwareDatetime | None = None
    """The moment of time 0."""
    program: str = ""
    """What wrote the file."""
    start: Seconds = 0.0
    """Time of the first frame of the part that was reviewed, seconds from that of the video."""
    end: Seconds | None = None
    """Time of its last frame; None: that of the video."""
    span: float = Field(60.0, gt=0)
    """Length of the spans that are checked at a time, from `start`, seconds."""
    lines: tuple[LineSettings, ...] = ()
    zones: tuple[ZoneSettings, ...] = ()
    reviewer: str | None = None
    saved: datetime | None = None
    sample: Sample | None = None
    checked: tuple[CheckedSpan, ...] = ()
    events: tuple[ReviewedEvent, ...] = ()
    """All errors, and what was counted rightly in the checked spans and near all errors."""
    _files: tuple[str, ...] = PrivateAttr(("corrections",))

    @model_validator(mode="after")
    def _fit_together(self) -> "Corrections":
        directions, times = self.traffic.directions, dict[str, list[float]]()
        for span in self.checked:
            if span.line not in directions:
                raise ValueError(f"checked: there is no line or zone {span.line}")
        for event in self.events:
            times.setdefault(event.name, []).append(event.time)
            for direction in (event.direction, event.true_direction):
                if direction not in directions.get(event.name, ()):
                    raise ValueError(f"events: {event.name} has no direction {direction}")
        for name, every in times.items():
            every.sort()
            for first, last in zip(every, every[MAX_A_SECOND:], strict=False):
                if last - first <= 1:
                    raise ValueError(
                        f"events: {name}, {first:g} s: more than {MAX_A_SECOND} within a second"
                    )
        return self

    @staticmethod
    def read(path: Path) -> "Corrections":
        """Read a file, YAML or the JSON of a page.

        Raises `ConfigError`, with the position of each mistake in YAML.
        """
        what = "file of corrections"
        document = None
        with suppress(ValueError, RecursionError):  # of JSON, which is read 50 times faster
            values = json.loads(read_whole(path, limit=MAX_BYTES, what=what, error=ConfigError))
            document = Document(str(path), values) if isinstance(values, dict) else None
        document = document or read_document(path, limit=MAX_BYTES, what=what)
        result = validated(Corrections, document)
        # Of 1.1.0: `start` is the time of the first frame, from which times count today.
        zero = result.start if result.end is None else 0.0
        by_whom = {"reviewer": result.reviewer, "saved": result.saved}
        events = (e.model_copy(update={"time": e.time - zero, **by_whom}) for e in result.events)
        spans = (
            span.model_copy(update={"start": span.start - zero, "end": span.end - zero})
            for span in result.checked
        )
        update = {"start": result.start - zero, "events": tuple(events), "checked": tuple(spans)}
        result = result.model_copy(update=update)
        result._files = (str(path),)
        return result

    @property
    def files(self) -> tuple[str, ...]:
        """Paths of the files."""
        return self._files

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

    def difference(self, video: SourceVideo) -> str | None:
        """Return in what a video of this name differs; None if it may be the one."""
        size = video.width, video.height
        if size != self.size:
            return "frames of {}×{}, not {}×{}".format(*size, *self.size)
        if (
            video.length
            and self.length
            and abs(video.length - self.length) > _SECONDS.total_seconds()
        ):
            return f"a length of {video.length:.1f} s, not {self.length:.1f} s"
        if video.begin and self.begin and abs(video.begin - self.begin) > _SECONDS:
            return f"the beginning {video.begin}, not {self.begin}"
        return None

    def merged(self, other: "Corrections") -> "Corrections":
        """Return the corrections of two reviewers of one video.

        Raises
        ------
        ConfigError
            They contradict each other: they correct an event in different ways, or one says that a
            vehicle passed where the list of the other has none, or only one corrects an event, and
            both have checked it.
        """
        pairs = paired(self.events, other.events)
        added = [b for a, b in pairs if b and not a]
        disputed = [a for a, b in pairs if a and b and a.truth != b.truth]
        disputed += [a for a, b in pairs if a and not b and other._disputes(a)]
        disputed += [event for event in added if self._disputes(event)]
        if disputed:
            raise ConfigError(
                f"{self.source} and {other.source}: contradict each other: {disputed[0]}; correct "
                "one of them"
            )
        best = max(self, other, key=lambda review: (len(review.drawn), review.span, -review.start))
        is_one = (self.start, self.end, self.span) == (other.start, other.end, other.span)
        drawn = {*best.drawn, *(self.drawn + other.drawn if is_one else ())}
        update = {
            "lines": tuple({line.name: line for line in self.lines + other.lines}.values()),
            "zones": tuple({zone.name: zone for zone in self.zones + other.zones}.values()),
            "events": (*self.events, *added),
            "checked": self.checked + other.checked,
            "sample": best.sample and Sample(seed=best.sample.seed, spans=tuple(sorted(drawn))),
        }
        result = best.model_copy(update=update)
        result._files = self._files + other._files
        return result

    @property
    def drawn(self) -> tuple[int, ...]:
        """The spans that were drawn."""
        return self.sample.spans if self.sample else ()

    def checks(self, name: str, time: float) -> list[CheckedSpan]:
        """Return the checked spans of a line or zone at a time, seconds in the video."""
        return [s for s in self.checked if s.line == name and s.start <= time < s.end]

    def shows(self, name: str, direction: str) -> bool:
        """Return whether a strip shows a direction: not what appears or vanishes in a zone."""
        return direction not in (APPEAR, VANISH) or name not in {zone.name for zone in self.zones}

    def lists(self, event: ReviewedEvent | Event) -> bool:
        """Return whether all that passed where and when an event is right is listed."""
        way = getattr(event, "true_direction", event.direction)
        spans = self.checks(event.name, event.time)
        return self.shows(event.name, way) and any(span.complete for span in spans)

    def _disputes(self, event: ReviewedEvent) -> bool:
        """Return whether an event that it lacks was checked, and is right elsewhere."""
        if self.lists(event):
            return event.truth is not None
        return bool(event.errors and self.checks(event.name, event.time))


def by_video(
    reviews: Iterable[Corrections],
    videos: Mapping[str, SourceVideo | None],
    traffic: TrafficSettings,
) -> dict[str, Corrections]:
    """Return the corrections of videos by their keys, merged; None: a video is not known.

    Raises
    ------
    ConfigError
        Corrections are not for exactly one of the videos, are for other lines than those of
        `traffic`, or contradict each other.
    """
    result: dict[str, Corrections] = {}
    for review in reviews:
        review.check(traffic)
        named = [
            k for k, video in videos.items() if video and may_be_same(video.name, review.video)
        ]
        named = named or [key for key, video in videos.items() if not video]
        differences = [video and review.difference(video) for video in map(videos.get, named)]
        keys = [key for key, other in zip(named, differences, strict=True) if not other]
        if len(keys) != 1:
            names = ", ".join(video.name if video else key for key, video in videos.items())
            fault = f"corrects {review.video}, which must be exactly one of these videos: {names}"
            if named and not keys:
                fault = f"corrects another {review.video}: this one has {differences[0]}"
            raise ConfigError(f"{review.source}: {fault}")
        before = result.get(keys[0])
        result[keys[0]] = before.merged(review) if before else review
    return result


def _is_same(first: Shape, second: Shape) -> bool:
    """Return whether two lines or zones have the same name, directions and points."""
    names, points = [], []
    for shape in (first, second):
        names.append(shape.model_dump(include={"name", "left", "right"}))
        points.append(np.vstack([getattr(shape, field) for field in shape.point_fields]))
    is_same = names[0] == names[1] and points[0].shape == points[1].shape
    return is_same and bool(np.hypot(*(points[0] - points[1]).T).max() <= _PIXELS)


@dataclass(slots=True)
class Judged:
    """An event as it was counted, and as it is right; None: it is not.

    `reviewed` is what a reviewer says of it, and `is_certain` whether that holds for its class and
    direction too; else it only tells which event is which. `fault` says why that does not fit.
    """

    reviewed: ReviewedEvent | None
    counted: Event | None
    right: Event | None
    is_certain: bool = False
    fault: str | None = None


def correct(
    videos: Mapping[str, Counts], corrections: Mapping[str, Corrections], settings: Settings
) -> dict[str, Counts]:
    """Return the counts of videos, corrected where there are corrections with the same key.

    In spans whose list is complete, the events are those of the list; elsewhere, single events are
    removed, added or changed. A vehicle gets another class in all its events, also in other videos.
    Only the classes of the settings are kept.
    """
    judged = {key: judge(counts, corrections.get(key)) for key, counts in videos.items()}
    _name_vehicles(list(chain.from_iterable(judged.values())))
    result = {}
    for key, counts in videos.items():
        chosen = [_of_classes(item, settings.classes) for item in judged[key]]
        right = sorted((item.right for item in chosen if item.right), key=Event.order)
        classes = settings.classes or counts.classes
        result[key] = replace(counts, events=tuple(right), classes=classes)
        if review := corrections.get(key):
            corrected = _corrected(counts, review, chosen)
            problems = (*corrected.faults, *map(_IMBALANCE.format, unbalanced_zones(result[key])))
            found = [Finding("corrections", problem) for problem in problems]
            if corrected.checked and not _is_within(counts, review):
                found.append(Finding("corrections", _BEYOND, severity="note"))
            findings = (*counts.findings, *found)
            result[key] = replace(result[key], corrected=corrected, findings=findings)
    return result


def apply_corrections(
    videos: Mapping[str, Counts], reviews: Sequence[Corrections], settings: Settings
) -> dict[str, Counts]:
    """Return the counts of saved tracks as `correct` does.

    Raises
    ------
    ConfigError
        As `by_video`; a correction does not fit the counts.
    """
    sources = {key: counts.source for key, counts in videos.items()}
    result = correct(videos, by_video(reviews, sources, settings.traffic), settings)
    every = (counts.corrected.faults for counts in result.values() if counts.corrected)
    if faults := list(chain.from_iterable(every)):
        raise ConfigError(*faults[:MAX_MISTAKES])
    return result


def judge(counts: Counts, review: Corrections | None) -> list[Judged]:
    """Return all events that were counted or are right; added vehicles have no number yet."""
    if review is None:
        return [Judged(None, event, event) for event in counts.events]
    (first, _), (_, last) = counts.spans[0], counts.spans[-1]
    start = -inf if counts.left_out is None else counts.left_out
    listed = [event for event in review.events if event.time >= start]
    inside = [event for event in listed if first - TOLERANCE <= event.time <= last + TOLERANCE]
    outside = f"is outside the counted part, {first:g} to {last:g} s"
    far = (e for e in listed if not first - TOLERANCE <= e.time <= last + TOLERANCE)
    items = [Judged(event, None, None, fault=outside) for event in far]
    classes = {e.id: e.true_class for e in listed if "class" in e.errors and e.id != NO_ID}
    for reviewed, event in paired(inside, counts.events):
        is_listed = any(side and review.lists(side) for side in (reviewed, event))
        item = Judged(reviewed, event, event, is_listed or bool(reviewed and reviewed.errors))
        if reviewed and (is_listed or "missed" in reviewed.errors or (event and item.is_certain)):
            item.right = _right(reviewed, classes.get(reviewed.id, reviewed.true_class), event)
        elif is_listed:
            item.right = None
        elif item.is_certain:
            item.fault = (
                f"no such event was counted within {TOLERANCE} s; remove this correction, or check "
                "these counts anew"
            )
        items.append(item)
    _complete_visits(items, counts.zones)
    return items


def _right(reviewed: ReviewedEvent, class_name: str, event: Event | None) -> Event | None:
    """Return an event as it is right; None: it is not."""
    if not reviewed.truth:
        return None
    added = Event(
        time=reviewed.time,
        frame=NO_FRAME,
        name=reviewed.name,
        direction=reviewed.true_direction,
        id=NO_ID,
        vehicle=NO_ID,
        class_name=class_name,
        score=None,
        source="reviewer",
    )
    if not event:
        return added
    name = event.class_name if class_of(event) == class_name else class_name
    return replace(event, time=added.time, direction=added.direction, class_name=name)


def _complete_visits(items: Sequence[Judged], zones: Collection[str]) -> None:
    """Remove both ends of a visit to a zone if a reviewer removes one of them."""
    visits = defaultdict[tuple[str, int], list[Judged]](list)
    for item in items:
        if item.counted and item.counted.name in zones:
            visits[item.counted.name, item.counted.vehicle].append(item)
    for ends in visits.values():
        ends.sort(key=lambda item: item.counted.time if item.counted else 0.0)
        for first, last in pairwise(ends):
            is_visit = first.counted and first.counted.direction in (ENTER, APPEAR)
            for removed, other in ((first, last), (last, first)):
                if is_visit and not removed.right and not other.is_certain:
                    other.right = None


def _name_vehicles(items: Sequence[Judged]) -> None:
    """Give added vehicles numbers, and others the class that a reviewer says, in all events."""
    numbers = count(max((item.counted.vehicle for item in items if item.counted), default=0) + 1)
    classes: dict[int, str | None] = {}
    for item in sorted(items, key=lambda item: not (item.reviewed and item.reviewed.errors)):
        if item.right and item.is_certain:
            classes.setdefault(item.right.vehicle, item.right.class_name)
    for item in items:
        if not item.right:
            continue
        if item.right.vehicle == NO_ID:
            item.right = replace(item.right, vehicle=next(numbers))
        elif not item.is_certain and item.right.vehicle in classes:
            item.right = replace(item.right, class_name=classes[item.right.vehicle])


def _of_classes(item: Judged, chosen: Collection[str]) -> Judged:
    """Return an event without what is not of the chosen classes."""
    counted, right = (
        event if event and is_chosen(event.class_name, chosen) else None
        for event in (item.counted, item.right)
    )
    return replace(item, counted=counted, right=right)


def _corrected(counts: Counts, review: Corrections, items: Sequence[Judged]) -> Corrected:
    """Return how counts were corrected."""
    names = {span.line for span in review.checked}
    checked = _checked(review, names)
    every = (
        Correction(item.counted, item.right, by.reviewer, by.saved)
        for item, by in ((item, item.reviewed or review) for item in items)
        if item.counted or item.right
    )
    faults = (f"{review.source}: {item.reviewed}: {item.fault}" for item in items if item.fault)
    return Corrected(
        counted=tuple(item.counted for item in items if item.counted),
        corrections=tuple(correction for correction in every if correction.errors),
        files=tuple(Path(name).name for name in review.files),
        names=tuple(dict.fromkeys(name for name, _ in counts.directions if name in names)),
        checked=tuple(
            (max(start, first), min(end, last))
            for start, end in checked
            for first, last in counts.spans
            if max(start, first) < min(end, last)
        ),
        observed=sum(last - first for first, last in counts.spans),
        estimates=tuple(_estimates(counts, review, items, checked)),
        faults=tuple(faults),
    )


def _checked(review: Corrections, names: Collection[str]) -> list[Span]:
    """Return when all lines and zones with these names were checked."""
    spans: list[Span] = []
    edges = sorted({edge for span in review.checked for edge in (span.start, span.end)})
    for start, end in pairwise(edges):
        if all(review.checks(name, start) for name in names):
            joined = spans.pop()[0] if spans and spans[-1][1] == start else start
            spans.append((joined, end))
    return spans


def covers(checked: Sequence[Span], span: Span) -> bool:
    """Return whether a span was checked, but for a frame or what is lost by rounding."""
    start, end = span
    return any(a < start + TOLERANCE and end < b + TOLERANCE for a, b in checked)


def _is_within(counts: Counts, review: Corrections) -> bool:
    """Return whether all that was counted is of the part that was reviewed."""
    (first, _), (_, last) = counts.spans[0], counts.spans[-1]
    end = inf if review.end is None else review.end
    return review.start - TOLERANCE <= first and last <= end + TOLERANCE


def _estimates(
    counts: Counts, review: Corrections, items: Sequence[Judged], checked: Sequence[Span]
) -> list[Estimate]:
    """Return the true number of events at the checked lines, as the page of the review does."""
    if not checked or not _is_within(counts, review):
        return []
    end = counts.spans[-1][1] if review.end is None else review.end
    spans = equal_spans(review.start, end, review.span, counts.spans)
    starts, names = [start for start, _ in spans.values()], {span.line for span in review.checked}
    ways = [(n, way) for n, way in counts.directions if n in names and review.shows(n, way)]
    groups = ALL, *(VehicleGroup(*way) for way in ways)
    numbers = {group: np.zeros((3, len(spans)), np.int64) for group in groups}
    for item in items:
        if event := item.right or item.counted:
            index = max(0, bisect_right(starts, event.time) - 1)
            before, after = (_groups(side, ways) for side in (item.counted, item.right))
            for group in dict.fromkeys(before + after):
                was, is_now = group in before, group in after
                of_group = numbers.setdefault(group, np.zeros((3, len(spans)), np.int64))
                of_group[:, index] += was, is_now > was, was > is_now
    known = [index for index, span in enumerate(spans.values()) if covers(checked, span)]
    drawn = [index for index, number in enumerate(spans) if number in review.drawn]
    return estimate(numbers, known, drawn)


def _groups(event: Event | None, ways: Collection[Direction]) -> tuple[VehicleGroup, ...]:
    """Return the groups of an event at a checked line."""
    if not event or (event.name, event.direction) not in ways:
        return ()
    direction = VehicleGroup(event.name, event.direction)
    return ALL, direction, VehicleGroup(class_name=class_of(event))
