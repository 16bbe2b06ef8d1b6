"""Records, counts and speeds of a video while it is processed."""

from dataclasses import replace
from typing import TYPE_CHECKING

from vdet.config.classes import is_chosen
from vdet.config.schema import Settings
from vdet.lanes.ground import ground_of
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Clock
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.counts import Counts
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
        The ground, or the corrections, do not fit the frames, `width` × `height` pixels, or the
        `name` of the video.
    """

    counter: VehicleCounter | None = None
    speeds: SpeedMeter | None = None
    vehicles: tuple[VehicleRecord, ...] = ()
    _final: Counts | None = None

    def __init__(
        self,
        settings: Settings,
        width: int,
        height: int,
        clock: Clock | None = None,
        *,
        corrections: "Corrections | None" = None,
        name: str | None = None,
    ) -> None:
        self.clock = clock
        self._corrections = corrections
        self._records = VehicleRecords(width)
        self._classes = settings.classes
        if settings.traffic:
            self.counter = VehicleCounter(settings, width, height)
        if corrections:
            borders = self.counter.borders if self.counter else ()
            corrections.check(borders, (width, height), name)
        if ground := ground_of(settings.camera, width, height):
            self.speeds = SpeedMeter(ground, width, height)

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

    def end(self, *, is_still: bool = False, doubts: tuple[str, ...] = ()) -> None:
        """Make records and counts, after the last frame.

        `is_still` as for `VehicleRecords.end`, `doubts` as in `Counts`.
        """
        if counts := self.counts():
            counts = replace(counts, doubts=doubts)
            self._final = self._corrections.apply(counts) if self._corrections else counts
        records = self._records.end(self.speeds, is_still=is_still)
        if self._final and self._final.corrected:
            for record in records:
                classes = self._final.corrected.classes
                record.class_name = classes.get(record.id, record.class_name)
        chosen = (record for record in records if is_chosen(record.class_name, self._classes))
        self.vehicles = tuple(chosen)
