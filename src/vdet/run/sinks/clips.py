"""The sink `clips`: a short video for each time in which a vehicle is shown."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from vdet.detect.classes import UNKNOWN
from vdet.media.cutting import can_copy, copied_suffix, copy_part, encode_part
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import BaseSink, SinkContext, SinkKind
from vdet.traffic.records import VehicleRecord

_NAME = re.compile(r"clip-[\dT-]+-\S+-\d+(\+\d+)?\.(mp4|mov|mkv)")
_PRECISION = 1_000_000  # parts of a second


@dataclass(frozen=True, slots=True)
class Scene:
    """A time in which vehicles are shown: seconds in the video, with the margins around it."""

    start: float
    end: float
    vehicles: tuple[VehicleRecord, ...]


def scenes(records: Iterable[VehicleRecord], margin: float) -> list[Scene]:
    """Return the times of vehicles with `margin` seconds around them; those that touch are one."""
    found: list[Scene] = []
    for record in sorted(records, key=lambda record: record.first):
        start, end = record.first - margin, record.last + margin
        if found and start <= found[-1].end:
            last = found.pop()
            start, end = last.start, max(end, last.end)
            found.append(Scene(start, end, (*last.vehicles, record)))
        else:
            found.append(Scene(start, end, (record,)))
    return found


class ClipSink(BaseSink):
    """Cuts the clips at the end of the run; with lines or zones, of vehicles counted there."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._folder = context.files.stage_folder(path, _NAME)

    def write(self, result: FrameResult) -> None:
        """Do nothing: the run keeps the records."""

    def finish(self) -> None:
        """Write the clips."""
        settings, source = self.context.settings, self.video.path
        copies = not settings.clips.exact and can_copy(source)
        suffix = copied_suffix(source) if copies else ".mp4"
        for scene in scenes(self._chosen(), settings.clips.margin):
            target = self._folder / f"{self._name(scene)}{suffix}"
            start, end = _exact(scene.start), _exact(scene.end)
            if copies:
                copy_part(source, start, end, target)
            else:
                first = self.video.start
                encode_part(
                    source,
                    max(start - first, Fraction(0)),
                    end - first,
                    target,
                    reading=settings.input,
                    writing=settings.output,
                )

    def _chosen(self) -> Sequence[VehicleRecord]:
        records = self.traffic.vehicles
        counts = self.traffic.counts()
        if counts is None:
            return records
        counted = {event.id for event in counts.events}
        return [record for record in records if record.id in counted]

    def _name(self, scene: Scene) -> str:
        first, clock = scene.vehicles[0], self.context.clock
        seconds = int(first.first)
        moment = f"{seconds // 3600:02}-{seconds // 60 % 60:02}-{seconds % 60:02}"
        if clock:
            moment = clock.at(first.first).strftime("%Y-%m-%dT%H-%M-%S")
        kind = re.sub(r"[^\w-]+", "-", first.class_name or UNKNOWN)
        others = f"+{len(scene.vehicles) - 1}" if len(scene.vehicles) > 1 else ""
        return f"clip-{moment}-{kind}-{first.id}{others}"


def _exact(seconds: float) -> Fraction:
    return Fraction(round(seconds * _PRECISION), _PRECISION)


CLIPS = SinkKind(ClipSink, what="clips", marker="clip-*.*", takes="videos")
