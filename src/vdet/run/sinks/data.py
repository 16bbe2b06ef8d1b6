"""The sinks that write data: tracks, JSON, labels, records of vehicles, counts, flows, findings.

Times are in seconds of the input. Pixels are those of the input frame, counted from 0.
"""

import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from vdet.boxes import Image
from vdet.errors import OutputError
from vdet.files import OutputFiles, json_text, print_now, valid_text, write_text
from vdet.findings import AT_LINES, without
from vdet.labels.coco import COCO, write_coco_images
from vdet.labels.images import LabelledImage
from vdet.labels.label import SourceVideo, TrackWriter, check_track_name, format_for, track_suffixes
from vdet.labels.lines import CLOCK, JSON_LINES, track_record
from vdet.pages.traffic import scene_picture, survey_image
from vdet.run.sinks.protocol import STANDARD_OUTPUT, BatchTotal, SinkContext, Writing, sink
from vdet.run.steps import findings_in
from vdet.traffic import output
from vdet.traffic.counter import source_video
from vdet.traffic.output import SUFFIXES, check_table, write_content, write_workbook
from vdet.traffic.records import join_records, records_content
from vdet.traffic.survey import Survey
from vdet.version import __version__


@sink(
    suffixes=track_suffixes,
    what="tracks",
    writes_standard_output=True,
    takes="videos",
    uses_traffic=False,
    check=check_track_name,
)
def tracks(path: Path, context: SinkContext) -> Writing:
    """Write the tracks of each frame; the ending of the name selects the format.

    The formats are those of `vdet.labels.label`. The path `-` stands for standard output, as
    `.jsonl`, frame by frame. `.jsonl` and `.coco.json` say what the video is (`SourceVideo`), and
    why the tracks may be wrong. In `.jsonl` and `.csv` a frame has its time of day in `clock`, if
    known. In `.jsonl` it has `lane` if lane finding is enabled: null if no lane is shown, else an
    object with `radius` (metres, null on a straight road), `offset` (of the camera from the middle
    of the lane, metres, positive to the right), `width` (metres), `left` and `right`: each line as
    `[[x, y], …]`, pixels of the frame, the nearest point first.
    """
    is_printed, (_, traffic) = path == STANDARD_OUTPUT, context.of_video
    form = JSON_LINES if is_printed else format_for(path)
    assert form is not None  # the suffixes of the kind say so
    stream = sys.stdout.buffer
    with nullcontext(stream) if is_printed else context.files.stage(path).open("wb") as file:
        writer = TrackWriter(form, file, _source(context))
        while result := (yield):
            frame = result.frame_tracks
            if clock := traffic.clock:
                clock_time = clock.at(frame.time).isoformat(" ", "microseconds")
                frame = replace(frame, facts={CLOCK: clock_time, **frame.facts})
            writer.write(frame)
            if is_printed:
                stream.flush()
        findings = findings_in(context.facts)
        writer.end((*without(findings.items, AT_LINES), *findings.facts))
        if is_printed:
            stream.flush()


def _source(context: SinkContext) -> SourceVideo:
    """Return what a file of tracks says of its video, and of the run."""
    video, traffic = context.of_video
    settings = context.settings.with_paths(lambda path: valid_text(Path(path).name))
    values = settings.model_dump(mode="json", exclude_defaults=True)
    for name, section in (("detector", settings.detector), ("tracker", settings.tracker)):
        values[name] = {"kind": section.kind, **values.get(name, {})}
    return replace(
        source_video(video, traffic.clock),
        rate=round(float(video.rate), 6),
        start=None if context.start is None else float(context.start),
        end=None if context.end is None else float(context.end),
        classes=settings.classes,
        program=f"vdet {__version__}",
        settings=values,
    )


@sink(suffixes=(COCO.suffix,), what="labels of images", takes="images")
def labels(path: Path, context: SinkContext) -> Writing:
    """Collect the boxes of images, and write them at the end as COCO, for label tools.

    An image is named by its path below the input folder.
    """
    images = []
    while result := (yield):
        name = context.places.get(result.source, Path(result.source.name))
        size = result.frame.picture.width, result.frame.picture.height
        images.append(LabelledImage(name, path, result.tracks, size))
    with context.files.stage(path).open("wb") as file:
        write_coco_images(file, images)


@sink(what="lists of boxes", writes_standard_output=True, takes="images")
def json(path: Path, context: SinkContext) -> Writing:
    """Collect an item per image, and write the list at the end, if it is not empty.

    Each item has `image`, `width`, `height` and `boxes`: the tracks of the image as in `.jsonl`,
    without `id` and `state`. If lane finding is enabled, it also has `lane`, as in `.jsonl`.
    """
    items = list[dict[str, Any]]()
    while result := (yield):
        picture, boxes = result.frame.picture, list(map(track_record, result.tracks))
        for box in boxes:
            del box["id"], box["state"]  # they mean nothing in a single image
        item = {
            "image": valid_text(str(result.source)),
            "width": picture.width,
            "height": picture.height,
        }
        items.append({**item, "boxes": boxes, **result.frame_tracks.facts})
    if items and path == STANDARD_OUTPUT:
        print_now(json_text(items))
    elif items:
        write_text(context.files.stage(path), json_text(items))


@sink(suffixes=(".json",), what="findings", takes="videos", uses_traffic=False)
def conditions(path: Path, context: SinkContext) -> Writing:
    """Write the reasons to doubt the results of the video: a list of findings."""
    while (yield):
        pass
    write_content(context.files.stage(path), findings_in(context.facts).record())


@sink(
    suffixes=SUFFIXES,
    what="records of vehicles",
    takes="videos",
    check=check_table,
    total=BatchTotal("all", join_records),
)
def vehicles(path: Path, context: SinkContext) -> Writing:
    """Write a record of each vehicle, and return all for the file over all videos."""
    while (yield):
        pass
    _, traffic = context.of_video
    records = records_content(traffic.vehicles, path, traffic.clock)
    write_content(context.files.stage(path), records)
    return records


_CONTENTS = {"counts": output.counts_content, "flows": output.flows_content}


def write_tables(
    survey: Survey, name: str, path: Path, files: OutputFiles, picture: Image | None
) -> None:
    """Write the `counts` or `flows` of a survey; the ending of the name selects the table.

    A workbook has everything, and the picture of the scene.
    """
    if output.is_workbook(path):
        return write_workbook(files.stage(path), survey.sheets(picture))
    content = _CONTENTS[name](path, survey.videos, survey.settings.traffic.seconds)
    return write_content(files.stage(path), content)


def _write_counts(name: str, path: Path, context: SinkContext) -> Writing:
    """Write the counts at lines and in zones, or the flows, at the end.

    A workbook has the frame that shows the most vehicles, or the picture of the settings.
    """
    if not context.settings.traffic:
        raise OutputError(f"{path}: no lines or zones to count at; add them to the settings")
    is_workbook, (_, traffic) = output.is_workbook(path), context.of_video
    scene = survey_image(context.settings) if is_workbook else None
    while result := (yield):
        if is_workbook:
            context.poster.add(result)
    survey, picture = context.survey, None
    assert survey  # the settings have lines or zones
    if is_workbook:
        image = context.poster.image(traffic.vehicles) if scene is None else scene
        assert image is not None  # a run has frames
        paths = {vehicle.id: vehicle.path for vehicle in traffic.vehicles}
        picture = scene_picture(image, survey.settings.traffic, survey.counts, paths)
    write_tables(survey, name, path, context.files, picture)


@sink(suffixes=output.COUNT_SUFFIXES, what="counts", takes="videos")
def counts(path: Path, context: SinkContext) -> Writing:
    """Write the counts at lines and in zones."""
    return _write_counts("counts", path, context)


@sink(suffixes=output.FLOW_SUFFIXES, what="flows", takes="videos")
def flows(path: Path, context: SinkContext) -> Writing:
    """Write the flows."""
    return _write_counts("flows", path, context)
