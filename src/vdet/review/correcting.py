"""Counts as reviewers say that they are right, and an estimate of what nobody has checked."""

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count, pairwise
from math import inf
from pathlib import Path

import numpy as np

from vdet.config.classes import is_chosen
from vdet.config.loading import MAX_MISTAKES
from vdet.config.schema import Settings
from vdet.errors import ConfigError
from vdet.findings import Finding
from vdet.labels.label import NO_ID
from vdet.review.corrections import TOLERANCE, Corrections, ReviewedEvent, by_video, paired
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
from vdet.traffic.crossings import APPEAR, ENTER

_IMBALANCE = "{}: after corrections, more vehicles enter than leave, or fewer; occupancy is unknown"
_BEYOND = "no estimate: more of the video was counted than was reviewed; review all of it"
NO_FRAME = -1
"""`Event.frame` of a vehicle that a reviewer added."""


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
