"""The counter of a video: from the tracks of each frame to events, with its records and speeds.

`vdet.traffic` explains the rule. `LiveTraffic` counts while a video is processed; saved tracks are
counted by `vdet.traffic.counting`.
"""

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING

from vdet.config.classes import is_chosen
from vdet.config.schema import Settings
from vdet.files import valid_text
from vdet.findings import Finding, Findings, with_counted, without
from vdet.lanes.camera import ground_of
from vdet.media import VideoInfo
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Clock, Span, add_frame
from vdet.traffic.counts import Counts, Direction, Event
from vdet.traffic.crossings import (
    MAX_GAP,
    VANISH,
    Border,
    Crossing,
    Line,
    TrackLinker,
    VehiclePath,
    crossings,
    lines_and_zones,
    lines_near,
)
from vdet.traffic.records import VehicleRecord, VehicleRecords
from vdet.traffic.speeds import SpeedMeter, with_speeds

if TYPE_CHECKING:
    from vdet.labels.label import SourceVideo

_MAX_AGE = 0.2
"""Seconds after which running counts are recomputed."""
_NEAR_LINE = 0.5
"""Distance within which the end of a track is at a line, in heights of its box."""
_FEW_WRONG = 0.05
"""Fraction of the crossings of a line up to which wrong tracks there cause no warning."""
_LONG_STEP = 0.21
"""Seconds between two frames that are too many to follow vehicles."""


@dataclass(frozen=True, slots=True)
class _PathEvents:
    """The events of a vehicle, and by line or zone the heights of its box at these, pixels.

    `missed` are the lines at which its path begins or ends without crossing them.
    """

    events: list[Event]
    heights: dict[str, list[float]]
    missed: list[str]


class VehicleCounter:
    """Counts the vehicles of one video, or of several that follow one another.

    Parameters
    ----------
    started
        Number of vehicles counted before.
    with_all_classes
        Count all, because corrections may be of any class; running counts keep to the settings.

    Attributes
    ----------
    lines, zones, borders
        In pixels of its frames.
    spans
        The parts with video, seconds.
    linker
        Knows how many vehicles have started.

    Raises
    ------
    ConfigError
        `camera.size` has another aspect ratio than `width` × `height` pixels.
    """

    def __init__(
        self,
        settings: Settings,
        width: int,
        height: int,
        started: int = 0,
        *,
        with_all_classes: bool = False,
    ) -> None:
        self._settings = settings
        self._running = settings.classes
        self._classes: Collection[str] = () if with_all_classes else settings.classes
        self.lines, self.zones = lines_and_zones(settings.traffic, width, height)
        self.spans: list[Span] = []
        self.borders: tuple[Border, ...] = (*self.lines, *self.zones)
        self.linker = TrackLinker(width, height, started)
        self._latest: FrameTracks | None = None
        self._steps = self._long_steps = 0
        self._ended: list[_PathEvents] = []
        self._ended_counts: Counter[Direction] = Counter()
        self._running_counts: Counter[Direction] = Counter()
        self._counted_at = -math.inf

    def update(self, frame: FrameTracks) -> None:
        """Add the tracks of the next frame."""
        add_frame(self.spans, frame, self._latest)
        if self._latest:
            self._steps += 1
            self._long_steps += frame.time - self._latest.time > _LONG_STEP
        self._latest = frame
        if paths := self.linker.add(frame):
            ended = self._passages(paths)
            self._ended += ended
            self._ended_counts.update(
                (event.name, event.direction)
                for passage in ended
                for event in passage.events
                if is_chosen(event.class_name, self._running)
            )

    def start_video(self) -> int:
        """Treat the ids of the next frames as other tracks, because they are of another video.

        Returns what `Event.id` is larger by.
        """
        self._latest = None
        return self.linker.start_video()

    def counts(self) -> Counts:
        """Return all results, as if the video ended now."""
        passages = self._ended + self._passages(self.linker.open_paths())
        events = [event for passage in passages for event in passage.events]
        events.sort(key=Event.order)
        directions = tuple((item.name, way) for item in self.borders for way in item.directions)
        findings = list(_line_findings(self.lines, passages))
        if lack := self._settings.camera.lack_of_speeds:
            findings.append(Finding("ground", lack))
        if 2 * self._long_steps > self._steps:
            text = "fewer than 5 frames per second: vehicles are missed; record more"
            findings.insert(0, Finding("frame-rate", text))
        return Counts(
            events=tuple(events),
            directions=directions,
            zones=tuple(zone.name for zone in self.zones),
            spans=tuple(self.spans) or ((0.0, 0.0),),
            findings=tuple(findings),
            outside_flows=self._settings.traffic.outside_flows,
            classes=self._settings.classes or self._settings.detector.vehicle_classes,
        )

    def so_far(self) -> Counter[Direction]:
        """Return the count of each direction so far; vehicles in a zone have not left it.

        The counts may be `_MAX_AGE` seconds old, so that this can be called for each frame.
        """
        now = self.spans[-1][1]
        if now - self._counted_at >= _MAX_AGE:
            self._counted_at = now
            self._running_counts = self._ended_counts + Counter(
                (event.name, event.direction)
                for passage in self._passages(self.linker.open_paths())
                for event in passage.events
                if is_chosen(event.class_name, self._running)
                if event.direction != VANISH or now - event.time > MAX_GAP
            )
        return self._running_counts

    def _passages(self, paths: Iterable[VehiclePath]) -> list[_PathEvents]:
        """Return the passages that count: of the classes, seen long enough, and not parked."""
        minimum, classes = self._settings.traffic.min_seen_seconds, self._classes
        seen = (path for path in paths if path.seconds >= minimum and path.has_moved)
        return [self._passage(path) for path in seen if is_chosen(path.class_name, classes)]

    def _passage(self, path: VehiclePath) -> _PathEvents:
        events, heights = list[Event](), {}
        for border in self.borders:
            crossed = crossings(path, border)
            events += [_event(path, border.name, crossing) for crossing in crossed]
            heights[border.name] = path.heights[[crossing.row for crossing in crossed]].tolist()
        # The ends of the path, except at the ends of the video.
        (start, _), (_, now) = self.spans[0], self.spans[-1]
        ends = [row for row in (0, path.seen - 1) if start < path.times[row] < now]
        uncrossed = [line for line in self.lines if not heights[line.name]]
        missed = lines_near(uncrossed, path.points[ends], _NEAR_LINE * path.heights[ends])
        return _PathEvents(events, heights, [line.name for line in missed])


def _event(path: VehiclePath, name: str, crossing: Crossing) -> Event:
    row = crossing.row
    return Event(
        time=round(crossing.time, 3),
        frame=int(path.frames[row]),
        name=name,
        direction=crossing.direction,
        id=int(path.ids[row]),
        vehicle=path.vehicle,
        class_name=path.class_name,
        score=round(float(path.scores[row]), 4),
        seconds=None if crossing.seconds is None else round(crossing.seconds, 3),
    )


def _line_findings(lines: Sequence[Line], passages: Sequence[_PathEvents]) -> Iterator[Finding]:
    """Yield each problem of a line that the tracks of a run show."""
    if lines and not passages:
        text = "no vehicle crossed a line; if there was traffic, move the line"
        yield Finding("nothing-found", text, severity="note")
        return
    for line in lines:
        crossed = [heights for passage in passages if (heights := passage.heights[line.name])]
        tolerated = _FEW_WRONG * len(crossed)
        missed = sum(line.name in passage.missed for passage in passages)
        repeated = sum(len(heights) > 1 for heights in crossed)
        problems = []
        if missed > tolerated:
            problems.append(
                f"tracks that begin or end at this line and are not counted: {missed}; move it to "
                "where vehicles are tracked longer"
            )
        if repeated > tolerated:
            problems.append(
                f"paths that cross this line more than once: {repeated}; place it across the road"
            )
        if crossed and line.length < median(height for heights in crossed for height in heights):
            problems.append("this line is shorter than a vehicle; make it longer")
        if not crossed:
            yield Finding("line", f"{line.name}: no vehicle crossed this line", severity="note")
        yield from (Finding("line", f"{line.name}: {problem}") for problem in problems)


def source_video(video: VideoInfo, clock: Clock | None) -> "SourceVideo":
    """Return what is known of a video before it is read."""
    from vdet.labels.label import SourceVideo  # runs without lines and tracks load no labels

    return SourceVideo(
        name=valid_text(video.path.as_posix()),
        width=video.width,
        height=video.height,
        length=None if video.duration is None else round(float(video.duration), 3),
        begin=clock.at(0.0) if clock else None,
        begin_source=clock.source if clock else None,
    )


class LiveTraffic:
    """Reads the tracks of a video, frame by frame, after all steps.

    Attributes
    ----------
    clock
        Start time of the video; None if unknown.
    counter
        None without lines and zones.
    speeds
        None without ground points.
    vehicles
        A record of each vehicle of the selected classes, by id; empty before `end`.
    source
        What is known of the video.
    counted
        The counts before they were revised; None before `end`.

    Raises
    ------
    ConfigError
        The lines, or the ground, do not fit the frames, `width` × `height` pixels.
    """

    def __init__(
        self,
        settings: Settings,
        width: int,
        height: int,
        clock: Clock | None = None,
        *,
        source: "SourceVideo | None" = None,
        with_all_classes: bool = False,
    ) -> None:
        self.clock, self.source = clock, source
        self._settings = settings
        self._records = VehicleRecords(width)
        self._ended: Sequence[VehicleRecord] = ()
        self._final: Counts | None = None
        self.counted: Counts | None = None
        self.vehicles: tuple[VehicleRecord, ...] = ()
        self.counter = None
        if settings.traffic:
            self.counter = VehicleCounter(
                settings, width, height, with_all_classes=with_all_classes
            )
        ground = ground_of(settings.camera, width, height)
        self.speeds = SpeedMeter(ground, width, height) if ground else None

    def add(self, frame: FrameTracks) -> None:
        """Add the tracks of the next frame."""
        self._records.add(frame)
        if self.counter:
            self.counter.update(frame)
        if self.speeds:
            self.speeds.add(frame)

    def counts(self) -> Counts | None:
        """Return all counts so far, with known speeds."""
        if self._final or self.counter is None:
            return self._final
        counts = replace(self.counter.counts(), clock=self.clock, source=self.source)
        return with_speeds(counts, self.speeds)

    def end(self, findings: Findings) -> None:
        """Make records and counts, after the last frame.

        `findings` are about the tracks.
        """
        self._ended = self._records.end(self.speeds, is_still=findings.is_still)
        if counts := self.counts():
            of_all = with_counted(findings.items, counts.findings)
            self.counted = replace(counts, findings=of_all)
            self.revise(self.counted)
        else:
            self._choose()

    def revise(self, counts: Counts) -> None:
        """Replace the counts after `end`.

        Vehicles get the class that was corrected in their events.
        """
        assert self.counted
        ignored = self._settings.conditions.ignore
        self._final = replace(counts, findings=without(counts.findings, ignored))
        if counts.corrected:
            before = {event.id: event.class_name for event in self.counted.events}
            changed = {
                event.id: event.class_name
                for event in counts.events
                if event.class_name != before.get(event.id)
            }
            for record in self._ended:
                if record.id in changed:
                    record.class_name = changed[record.id]
                    record.corrected = counts.corrected.files
        self._choose()

    def _choose(self) -> None:
        classes = self._settings.classes
        chosen = (record for record in self._ended if is_chosen(record.class_name, classes))
        self.vehicles = tuple(chosen)
