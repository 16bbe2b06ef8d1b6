"""The sinks that write data: tracks, JSON, labels, records of vehicles, counts, flows, findings.

Times are in seconds of the input. Pixels are those of the input frame, counted from 0.
"""

import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, Self

from vdet.errors import OutputError
from vdet.files import json_text, print_now, valid_text, write_text
from vdet.findings import AT_LINES, without
from vdet.labels.coco import COCO, write_coco_images
from vdet.labels.formats import (
    TrackWriter,
    check_track_name,
    format_for,
    track_suffixes,
)
from vdet.labels.images import LabelledImage
from vdet.labels.label import SourceVideo
from vdet.labels.lines import CLOCK, JSON_LINES, track_record
from vdet.pages.traffic import scene_picture, survey_image
from vdet.run.sinks.protocol import STANDARD_OUTPUT, BaseSink, BatchTotal, SinkContext, SinkKind
from vdet.run.steps import FrameResult, findings_in
from vdet.traffic import output
from vdet.traffic.live import source_video
from vdet.traffic.records import join_records, records_content
from vdet.traffic.tables import SUFFIXES, check_table, write_content
from vdet.traffic.workbook import write_workbook
from vdet.version import __version__

MakeContent = Callable[[Path, output.Videos, int | None], Any]


class TrackSink(BaseSink):
    """Writes the tracks of each frame; the ending of the name selects the format.

    The formats are those of `vdet.labels.formats`. The path `-` stands for standard output, as
    `.jsonl`, frame by frame. `.jsonl` and `.coco.json` say what the video is (`SourceVideo`), and
    why the tracks may be wrong. In `.jsonl` and `.csv` a frame has its time of day in `clock`, if
    known. In `.jsonl` it has `lane` if lane finding is enabled: null if no lane is shown, else an
    object with `radius` (metres, null on a straight road), `offset` (of the camera from the middle
    of the lane, metres, positive to the right), `width` (metres), `left` and `right`: each line as
    `[[x, y], …]`, pixels of the frame, the nearest point first.
    """

    _file: BinaryIO | None = None
    _writer: TrackWriter

    def __enter__(self) -> Self:
        if self.path == STANDARD_OUTPUT:
            self._writer = TrackWriter(JSON_LINES, sys.stdout.buffer, self._source())
            return self
        form = format_for(self.path)
        assert form is not None  # the suffixes of the kind say so
        self._file = self.context.files.stage(self.path).open("wb")
        self._writer = TrackWriter(form, self._file, self._source())
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._file or nullcontext():
            if kind is None:
                findings = findings_in(self.context.facts)
                self._writer.end((*without(findings.items, AT_LINES), *findings.facts))
        if self._file is None:
            sys.stdout.flush()

    def _source(self) -> SourceVideo:
        video, clock, context = self.video, self.traffic.clock, self.context
        settings = context.settings.with_paths(lambda path: valid_text(Path(path).name))
        values = settings.model_dump(mode="json", exclude_defaults=True)
        for name, section in (("detector", settings.detector), ("tracker", settings.tracker)):
            values[name] = {"kind": section.kind, **values.get(name, {})}
        return replace(
            source_video(video, clock),
            rate=round(float(video.rate), 6),
            start=None if context.start is None else float(context.start),
            end=None if context.end is None else float(context.end),
            classes=settings.classes,
            program=f"vdet {__version__}",
            settings=values,
        )

    def write(self, result: FrameResult) -> None:
        """Add the tracks of a frame."""
        frame, clock = result.frame_tracks, self.traffic.clock
        if clock:
            clock_time = clock.at(frame.time).isoformat(" ", "microseconds")
            frame = replace(frame, facts={CLOCK: clock_time, **frame.facts})
        self._writer.write(frame)
        if self._file is None:
            sys.stdout.flush()


TRACKS = SinkKind(
    TrackSink,
    track_suffixes,
    "tracks",
    writes_standard_output=True,
    takes="videos",
    uses_traffic=False,
    check=check_track_name,
)


class LabelSink(BaseSink):
    """Collects the boxes of images, and writes them at the end as COCO, for label tools.

    An image is named by its path below the input folder.
    """

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._images: list[LabelledImage] = []

    def finish(self) -> None:
        """Write the file."""
        with self.context.files.stage(self.path).open("wb") as file:
            write_coco_images(file, self._images)

    def write(self, result: FrameResult) -> None:
        """Add an image."""
        name = self.context.places.get(result.source, Path(result.source.name))
        size = result.frame.picture.width, result.frame.picture.height
        self._images.append(LabelledImage(name, self.path, result.tracks, size))


LABELS = SinkKind(LabelSink, (COCO.suffix,), "labels of images", takes="images")


class JsonSink(BaseSink):
    """Collects an item per image, and writes the list at the end, if it is not empty.

    Each item has `image`, `width`, `height` and `boxes`: the tracks of the image as in `.jsonl`,
    without `id` and `state`. If lane finding is enabled, it also has `lane`, as in `.jsonl`.
    """

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._items: list[dict[str, Any]] = []

    def finish(self) -> None:
        """Write the list."""
        if self._items and self.path == STANDARD_OUTPUT:
            print_now(json_text(self._items))
        elif self._items:
            write_text(self.context.files.stage(self.path), json_text(self._items))

    def write(self, result: FrameResult) -> None:
        """Add the item of an image."""
        picture, boxes = result.frame.picture, list(map(track_record, result.tracks))
        for box in boxes:
            del box["id"], box["state"]  # they mean nothing in a single image
        item = {
            "image": valid_text(str(result.source)),
            "width": picture.width,
            "height": picture.height,
        }
        self._items.append({**item, "boxes": boxes, **result.frame_tracks.facts})


JSON = SinkKind(JsonSink, what="lists of boxes", writes_standard_output=True, takes="images")


class TableSink(BaseSink):
    """Writes a table or JSON at the end of the video; `make` makes it from the sink."""

    def __init__(
        self, make: Callable[["TableSink"], Any], path: Path, context: SinkContext
    ) -> None:
        super().__init__(path, context)
        self._make = make

    def finish(self) -> None:
        """Write it, and keep it for the file over all videos."""
        self.summary = self._make(self)
        write_content(self.context.files.stage(self.path), self.summary)


def _records(sink: TableSink) -> Any:
    """Return a record of each vehicle, for `.csv`, `.json` or `.parquet`."""
    return records_content(sink.traffic.vehicles, sink.path, sink.traffic.clock)


def _findings(sink: TableSink) -> Any:
    """Return the reasons to doubt the results of the video: a list of findings."""
    return findings_in(sink.context.facts).record()


CONDITIONS = SinkKind(
    partial(TableSink, _findings), (".json",), "findings", takes="videos", uses_traffic=False
)
VEHICLES = SinkKind(
    partial(TableSink, _records),
    SUFFIXES,
    "records of vehicles",
    takes="videos",
    check=check_table,
    total=BatchTotal("all", join_records),
)


class WorkbookSink(BaseSink):
    """Writes the workbook, with the frame that shows the most vehicles."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._image = survey_image(context.settings)

    def write(self, result: FrameResult) -> None:
        """Look for more vehicles."""
        self.context.poster.add(result)

    def finish(self) -> None:
        """Write the file."""
        survey, vehicles, image = self.context.survey, self.traffic.vehicles, self._image
        image = self.context.poster.image(vehicles) if image is None else image
        assert survey  # the settings have lines or zones
        assert image is not None  # a run has frames
        paths = {vehicle.id: vehicle.path for vehicle in vehicles}
        picture = scene_picture(image, survey.settings.traffic, survey.counts, paths)
        write_workbook(self.context.files.stage(self.path), survey.sheets(picture))


def _count_sink(make: MakeContent, path: Path, context: SinkContext) -> BaseSink:
    """Return a sink of the counts at lines and in zones, or of the flows.

    `make` is `counts_content` or `flows_content`; the ending of the name selects the table.
    """
    traffic = context.settings.traffic
    if not traffic:
        raise OutputError(f"{path}: no lines or zones to count at; add them to the settings")

    if output.is_workbook(path):
        return WorkbookSink(path, context)

    def content(sink: TableSink) -> Any:
        survey = sink.context.survey
        assert survey  # the settings have lines or zones
        return make(path, survey.videos, traffic.seconds)

    return TableSink(content, path, context)


COUNTS = SinkKind(
    partial(_count_sink, output.counts_content), output.COUNT_SUFFIXES, "counts", takes="videos"
)
FLOWS = SinkKind(
    partial(_count_sink, output.flows_content), output.FLOW_SUFFIXES, "flows", takes="videos"
)
