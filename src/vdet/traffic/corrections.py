"""Corrections: what reviewers found wrong in counts, read from files and applied to events."""

from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import reduce
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PrivateAttr, model_validator

from vdet.config.classes import our_name
from vdet.config.document import read_document
from vdet.config.loading import validated
from vdet.config.section import Section
from vdet.config.shapes import LineSettings, Name, Size, TrafficSettings, ZoneSettings
from vdet.errors import ConfigError
from vdet.labels.label import NO_ID
from vdet.traffic.counts import Checked, Corrected, Counts, Event
from vdet.traffic.crossings import Border, Line, lines_and_zones

MAX_BYTES = 5_000_000
"""Size of a file of some 50,000 corrections."""
TOLERANCE = 0.5
"""Maximum seconds between two passages that are the same one."""
_OTHER = 0.01
"""Seconds that a passage by another id or class counts as farther away."""
_PIXELS = 1.0
"""Maximum distance of the points of the same line, pixels of the frames at hand."""
NO_FRAME = -1
"""`Event.frame` of a vehicle that a reviewer added."""

Error = Literal["false", "missed", "class", "direction"]
"""Nothing passed; something passed that was not counted; a wrong class; a wrong direction."""
_ErrorText = Annotated[Error, BeforeValidator(lambda value: "false" if value is False else value)]
"""As YAML has it, where `false` without quotes is no text."""


class Sample(Section):
    """The minutes of the video that were drawn to be checked, from 0, and the seed."""

    seed: int
    minutes: tuple[int, ...] = ()


class CheckedSpan(Section):
    """A part of the video that was checked at a line or zone; seconds in the video."""

    line: Name
    start: float
    end: float


class Correction(Section):
    """An error in the counts: what was counted, or missed, and what is `correct`."""

    line: Name
    """The line or zone."""
    time: float
    """Seconds in the video, as in the table of events."""
    direction: Name
    class_name: Name | None = Field(None, alias="class")
    id: int = NO_ID
    error: _ErrorText
    correct: Name | None = None
    """The class or the direction."""

    @model_validator(mode="after")
    def _says_what_is_correct(self) -> "Correction":
        if (self.correct is None) == (self.error in ("class", "direction")):
            need = "needs" if self.correct is None else "does not accept"
            raise ValueError(f"error: {self.error} {need} correct")
        return self


@dataclass(frozen=True, slots=True, order=True)
class Passage:
    """A vehicle at a line or zone: when, which way, and of which class and track it is."""

    time: float
    name: str
    direction: str
    class_name: str = ""
    id: int = NO_ID

    @staticmethod
    def of(event: Event) -> "Passage":
        """Return the passage of an event."""
        return Passage(event.time, event.name, event.direction, event.class_name or "", event.id)

    def __str__(self) -> str:
        kind = f", {self.class_name}" if self.class_name else ""
        return f"{self.name}, {self.time:g} s, {self.direction}{kind}"

    def distance(self, other: "Passage") -> float:
        """Return the seconds to another passage, somewhat more if its id or class differs."""
        differing = (self.id != other.id) + (self.class_name != other.class_name)
        return abs(self.time - other.time) + _OTHER * differing


def paired(wanted: Sequence[Passage], known: Sequence[Passage]) -> dict[int, int]:
    """Return for the numbers of wanted passages those of the known ones that are the same.

    They are at the same line, in the same direction, and within `TOLERANCE`; the nearest pairs
    first. A passage is in one pair at most.
    """
    by_way: dict[tuple[str, str], list[tuple[float, int]]] = defaultdict(list)
    for number, place in enumerate(known):
        by_way[place.name, place.direction].append((place.time, number))
    for moments in by_way.values():
        moments.sort()
    candidates = []
    for number, one in enumerate(wanted):
        moments = by_way.get((one.name, one.direction), [])
        first = bisect_left(moments, (one.time - TOLERANCE, NO_ID))
        end = bisect_right(moments, (one.time + TOLERANCE, len(known)))
        candidates += [(known[n].distance(one), number, n) for _, n in moments[first:end]]
    pairs: dict[int, int] = {}
    taken: set[int] = set()
    for _, number, other in sorted(candidates):
        if number not in pairs and other not in taken:
            pairs[number] = other
            taken.add(other)
    return pairs


@dataclass(frozen=True, slots=True)
class _Verdict:
    """What is wrong with a passage: what is correct, by the error."""

    passage: Passage
    fixes: Mapping[Error, str | None]
    corrections: tuple[Correction, ...]


class Corrections(Section):
    """The corrections of the counts of a video, made by one reviewer, or merged from several."""

    video: str
    """Name of the video."""
    size: Size
    """Width and height of the frames that the points refer to."""
    lines: tuple[LineSettings, ...] = ()
    zones: tuple[ZoneSettings, ...] = ()
    reviewer: str | None = None
    saved: datetime | None = None
    sample: Sample | None = None
    checked: tuple[CheckedSpan, ...] = ()
    events: tuple[Correction, ...] = ()
    _files: tuple[str, ...] = PrivateAttr(("corrections",))

    @model_validator(mode="after")
    def _fit_together(self) -> "Corrections":
        ways = {border.name: border.directions for border in self.borders(*self.size)}
        for span in self.checked:
            if span.line not in ways:
                raise ValueError(f"checked: there is no line or zone {span.line}")
        for one in self.events:
            expected = ways.get(one.line, ())
            for way in (one.direction, one.correct if one.error == "direction" else None):
                if way not in (*expected, None):
                    raise ValueError(f"events: {one.line} has no direction {way}")
        for verdict in self._verdicts():
            if len(verdict.fixes) < len(verdict.corrections) or (
                "false" in verdict.fixes and len(verdict.fixes) > 1
            ):
                raise ValueError(f"events: {verdict.passage}: is corrected twice; remove one")
        return self

    @staticmethod
    def read(path: Path) -> "Corrections":
        """Read a file. Raises `ConfigError`, with the position of each mistake."""
        document = read_document(path, limit=MAX_BYTES, what="file of corrections")
        corrections = validated(Corrections, document)
        corrections._files = (str(path),)
        return corrections

    @property
    def source(self) -> str:
        """The files, for messages."""
        return ", ".join(self._files)

    def borders(self, width: int, height: int) -> tuple[Border, ...]:
        """Return the lines and zones in frames of this size. Raises `ConfigError`."""
        update = {"size": self.size}
        lines = tuple(line.model_copy(update=update) for line in self.lines)
        zones = tuple(zone.model_copy(update=update) for zone in self.zones)
        own_lines, own_zones = lines_and_zones(
            TrafficSettings(lines=lines, zones=zones), width, height
        )
        return *own_lines, *own_zones

    def check(self, borders: Sequence[Border], size: tuple[int, int], video: str | None) -> None:
        """Raise `ConfigError` if it is of another video, or other lines, than those at hand.

        `borders` are in pixels of frames of this size; the name of the video may be unknown.
        """
        if video not in (self.video, None):
            raise ConfigError(f"{self.source}: corrects {self.video}, not {video}")
        try:
            own_borders = self.borders(*size)
        except ConfigError as error:
            raise ConfigError(f"{self.source}: {str(error).removeprefix('camera.')}") from error
        at_hand = {border.name: border for border in borders}
        for own in own_borders:
            other = at_hand.get(own.name)
            if not other or not _is_same(own, other):
                raise ConfigError(
                    f"{self.source}: {own.name} is not where these settings have it; count with "
                    "the settings of the review"
                )

    def merged(self, other: "Corrections") -> "Corrections":
        """Return the corrections of two reviewers of one video.

        Raises
        ------
        ConfigError
            They are of different videos or lines, or contradict each other: they correct an event
            in different ways, or only one of them corrects it and the other has checked it too.
        """
        other.check(self.borders(*self.size), self.size, self.video)
        own, others = list(self._verdicts()), list(other._verdicts())
        pairs = paired([one.passage for one in own], [one.passage for one in others])
        for number, one in enumerate(own):
            partner = others[pairs[number]] if number in pairs else None
            if (partner and _opinion(partner) != _opinion(one)) or (
                not partner and other.has_checked(one.passage)
            ):
                raise _contradiction(self, other, one)
        alone = [one for number, one in enumerate(others) if number not in pairs.values()]
        for one in alone:
            if self.has_checked(one.passage):
                raise _contradiction(other, self, one)
        added = tuple(correction for one in alone for correction in one.corrections)
        update = {"events": self.events + added, "checked": self.checked + other.checked}
        result = self.model_copy(update=update)
        result._files = self._files + other._files
        return result

    def has_checked(self, passage: Passage) -> bool:
        """Return whether the line was checked at the time of a passage."""
        return any(
            span.line == passage.name and span.start <= passage.time < span.end
            for span in self.checked
        )

    def apply(self, counts: Counts) -> Counts:
        """Return corrected counts.

        An event is removed, added, or has another direction; a vehicle has another class in all its
        events. Raises `ConfigError` if a correction fits no event, or a vehicle has two classes.
        """
        verdicts = list(self._verdicts())
        found = [verdict for verdict in verdicts if "missed" not in verdict.fixes]
        pairs = paired([one.passage for one in found], list(map(Passage.of, counts.events)))
        classes: dict[int, str] = {}
        by_event: dict[int, _Verdict] = {}
        for number, verdict in enumerate(found):
            if number not in pairs:
                raise ConfigError(
                    f"{self.source}: {verdict.passage}: no such event was counted within "
                    f"{TOLERANCE} s; remove this correction, or check these counts anew"
                )
            by_event[pairs[number]] = verdict
            if kind := verdict.fixes.get("class"):
                vehicle = counts.events[pairs[number]].vehicle
                if classes.setdefault(vehicle, _class(kind)) != _class(kind):
                    raise ConfigError(
                        f"{self.source}: {verdict.passage}: the same vehicle is a "
                        f"{classes[vehicle]} in another correction; remove one"
                    )
        events = []
        for number, event in enumerate(counts.events):
            fixes = by_event[number].fixes if number in by_event else {}
            if "false" not in fixes:
                direction = fixes.get("direction") or event.direction
                kind = classes.get(event.vehicle, event.class_name)
                events.append(replace(event, direction=direction, class_name=kind))
        added = (one.passage for one in verdicts if "missed" in one.fixes)
        events += _added(added, 1 + max((event.vehicle for event in counts.events), default=0))
        events.sort(key=lambda event: (event.time, event.frame, event.id, event.name))
        corrected = Corrected(
            events=len(verdicts),
            files=tuple(Path(name).name for name in self._files),
            checked=tuple(Checked(span.line, span.start, span.end) for span in self.checked),
            classes={
                event.id: classes[event.vehicle]
                for event in counts.events
                if event.vehicle in classes
            },
        )
        return replace(counts, events=tuple(events), corrected=corrected)

    def _verdicts(self) -> Iterator[_Verdict]:
        """Yield what is wrong with each passage."""
        by_passage: dict[tuple[Passage, int], list[Correction]] = defaultdict(list)
        for number, one in enumerate(self.events):
            passage = Passage(one.time, one.line, one.direction, one.class_name or "", one.id)
            key = number if one.error == "missed" else NO_ID  # two may pass at the same time
            by_passage[passage, key].append(one)
        for (passage, _), ones in by_passage.items():
            yield _Verdict(passage, {one.error: one.correct for one in ones}, tuple(ones))


def read_corrections(paths: Sequence[Path]) -> Corrections | None:
    """Read files, and merge them; None if there are none. Errors as `Corrections` has them."""
    return reduce(Corrections.merged, map(Corrections.read, paths)) if paths else None


def _class(label: str) -> str:
    return our_name(label) or label


def _added(missed: Iterator[Passage], vehicle: int) -> Iterator[Event]:
    """Yield the events of missed vehicles, which get new numbers from `vehicle` on."""
    for number, passage in enumerate(missed, start=vehicle):
        yield Event(
            time=passage.time,
            frame=NO_FRAME,
            name=passage.name,
            direction=passage.direction,
            id=NO_ID,
            vehicle=number,
            class_name=_class(passage.class_name) if passage.class_name else None,
            score=1.0,
        )


def _opinion(verdict: _Verdict) -> tuple[Mapping[Error, str | None], str]:
    """Return what two reviewers must agree on."""
    return verdict.fixes, verdict.passage.class_name if "missed" in verdict.fixes else ""


def _contradiction(one: Corrections, other: Corrections, verdict: _Verdict) -> ConfigError:
    return ConfigError(
        f"{one.source} and {other.source}: contradict each other: {verdict.passage}: "
        f"{' and '.join(verdict.fixes)} in the first only; correct one of them"
    )


def _is_same(own: Border, other: Border) -> bool:
    """Return whether two lines or zones have the same points and directions."""
    places = [
        np.array([shape.start, shape.end] if isinstance(shape, Line) else shape.corners)
        for shape in (own, other)
    ]
    return (
        own.directions == other.directions
        and isinstance(own, Line) == isinstance(other, Line)
        and places[0].shape == places[1].shape
        and bool(np.hypot(*(places[0] - places[1]).T).max() <= _PIXELS)
    )
