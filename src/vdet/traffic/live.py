"""Records, counts and speeds of a video while it is processed."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from vdet.config.classes import is_chosen
from vdet.config.schema import Settings
from vdet.files import valid_text
from vdet.findings import Findings, with_counted, without
from vdet.lanes.ground import ground_of
from vdet.media import VideoInfo
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Clock
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.counts import Counts
from vdet.traffic.records import VehicleRecord, VehicleRecords
from vdet.traffic.speeds import SpeedMeter, with_speeds

if TYPE_CHECKING:
    from vdet.labels.label import SourceVideo


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
