"""Records, counts and speeds of a video while it is processed."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from vdet.config.classes import is_chosen
from vdet.config.schema import Settings
from vdet.files import valid_text
from vdet.findings import Findings, without
from vdet.lanes.ground import ground_of
from vdet.media import VideoInfo
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Clock
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.counts import Counts, Trace
from vdet.traffic.records import VehicleRecord, VehicleRecords
from vdet.traffic.speeds import SpeedMeter, with_speeds

if TYPE_CHECKING:
    from vdet.labels.label import SourceVideo
    from vdet.traffic.corrections import Corrections


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
    corrections
        What reviewers say of the counts.
    counted
        The counts before corrections; None before `end`.

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
        corrections: "Corrections | None" = None,
    ) -> None:
        self.clock = clock
        self.corrections = corrections
        self._source, self._settings = source, settings
        self._records = VehicleRecords(width)
        self._final: Counts | None = None
        self.counted: Counts | None = None
        self.vehicles: tuple[VehicleRecord, ...] = ()
        if corrections:  # they may be of any class; the selection follows
            settings = settings.model_copy(update={"classes": ()})
        self.counter = None
        if settings.traffic:
            chosen = self._settings.classes
            self.counter = VehicleCounter(settings, width, height, running=chosen)
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
        counts = replace(self.counter.counts(), clock=self.clock, source=self._source)
        return with_speeds(counts, self.speeds)

    def add_traces(self, traces: Sequence[Trace]) -> None:
        """Add what passed without a track to the counts, with its findings, after `end`."""
        from vdet.traffic.traces import trace_findings  # most runs have no strips

        if self._final:
            counts = replace(self._final, traces=tuple(traces))
            found = without(trace_findings(counts), self._settings.conditions.ignore)
            self._final = replace(counts, findings=counts.findings + found)

    def end(self, findings: Findings) -> None:
        """Make records and counts, after the last frame.

        `findings` are about the tracks.
        """
        records = self._records.end(self.speeds, is_still=findings.is_still)
        if counts := self.counts():
            counts = replace(counts, findings=(*findings.items, *counts.findings))
            self.counted = counts
            if self.corrections:
                from vdet.traffic.correcting import correct  # most runs load nothing of it

                counts = correct({"": counts}, {"": self.corrections}, self._settings)[""]
                _correct(records, self.counted, counts)
            ignored = self._settings.conditions.ignore
            self._final = replace(counts, findings=without(counts.findings, ignored))
        classes = self._settings.classes
        chosen = (record for record in records if is_chosen(record.class_name, classes))
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
