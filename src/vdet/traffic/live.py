"""Records, counts and speeds of a video while it is processed."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from vdet.config.classes import is_chosen
from vdet.config.schema import Settings
from vdet.findings import Findings, without
from vdet.lanes.ground import ground_of
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Clock
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.counts import Counts, Trace
from vdet.traffic.records import VehicleRecord, VehicleRecords
from vdet.traffic.speeds import SpeedMeter, with_speeds

if TYPE_CHECKING:
    from vdet.traffic.corrections import Corrections


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
        corrections: "Corrections | None" = None,
    ) -> None:
        self.clock = clock
        self._corrections = corrections
        self._records = VehicleRecords(width)
        self._classes, self._ignored = settings.classes, settings.conditions.ignore
        self._final: Counts | None = None
        self.vehicles: tuple[VehicleRecord, ...] = ()
        if corrections:  # they may be of any class; the selection follows
            settings = settings.model_copy(update={"classes": ()})
        self.counter = None
        if settings.traffic:
            self.counter = VehicleCounter(settings, width, height, running=self._classes)
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
        return with_speeds(replace(self.counter.counts(), clock=self.clock), self.speeds)

    def add_traces(self, traces: Sequence[Trace]) -> None:
        """Add what passed without a track to the counts, with its findings, after `end`."""
        from vdet.traffic.traces import trace_findings  # most runs have no strips

        if self._final:
            counts = replace(self._final, traces=tuple(traces))
            found = without(trace_findings(counts), self._ignored)
            self._final = replace(counts, findings=counts.findings + found)

    def end(self, findings: Findings) -> None:
        """Make records and counts, after the last frame.

        `findings` are about the tracks.
        """
        records = self._records.end(self.speeds, is_still=findings.is_still)
        if counts := self.counts():
            self._final = counts = replace(
                counts, findings=without((*findings.items, *counts.findings), self._ignored)
            )
            if self._corrections:
                self._final = self._corrections.apply(counts, self._classes)
                _correct(records, counts, self._final)
        chosen = (record for record in records if is_chosen(record.class_name, self._classes))
        self.vehicles = tuple(chosen)


def _correct(records: Iterable[VehicleRecord], counts: Counts, corrected: Counts) -> None:
    """Give vehicles the class that was corrected in their events."""
    classes = {event.id: event.class_name for event in counts.events}
    changed = {
        event.id: event.class_name
        for event in corrected.events
        if event.class_name != classes.get(event.id)
    }
    for record in records:
        if record.id in changed and corrected.corrected:
            record.class_name = changed[record.id]
            record.corrected = corrected.corrected.files
