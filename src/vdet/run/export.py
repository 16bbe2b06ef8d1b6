"""Checked vehicles as labelled images, from which a network learns."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from vdet.boxes import Box
from vdet.errors import ConfigError
from vdet.files import OutputFiles
from vdet.labels.coco import write_coco_images
from vdet.labels.formats import ImageTracks
from vdet.labels.label import Size
from vdet.media.images import encode_image
from vdet.media.reader import VideoReader
from vdet.progress import Steps
from vdet.run.scene import saved_frames
from vdet.run.video import Run
from vdet.track.track import FrameTracks
from vdet.traffic.corrections import read_corrections
from vdet.traffic.counting import count_frames
from vdet.traffic.counts import class_of

LABELS_NAME = "labels.coco.json"


def export_checked(run: Run, tracks: Path, folder: Path, steps: Steps) -> None:
    """Write the frames in which checked vehicles cross lines.

    The run has corrections. A vehicle is labelled, with its corrected class, in the frame in which
    it crosses a line in a checked minute. Everything else in the frame is an ignore region.

    Raises `VdetError` if an input cannot be used, no vehicle was checked, or an output cannot be
    written.
    """
    settings, inputs = run.settings, run.inputs
    reviews = read_corrections(run.corrections)
    files = OutputFiles(overwrite=run.overwrite, inputs=inputs)
    files.check(folder / LABELS_NAME, makes_folder=True)
    with (
        VideoReader(run.source, start=run.start, end=run.end, settings=settings.input) as reader,
        files,
    ):
        size, name = (reader.info.width, reader.info.height), run.source.name
        frames = {frame.index: frame for frame in saved_frames(tracks, run, size, reader.info)}
        counts = count_frames(frames.values(), settings, size, corrections=reviews, name=name)
        checked = {
            (event.frame, event.id): class_of(event)
            for event in counts.events
            if any(review.has_checked(event) for review in reviews)
        }
        target, images = files.stage_folder(folder), []
        advance = steps("", reader.expected)
        for frame in reader:
            advance(1)
            if frame.index not in frames:
                continue
            path = target / f"{run.source.stem}-{frame.index:06}.jpg"
            image = _labelled(frames[frame.index], checked, Path(path.name), size)
            if image.tracks:
                path.write_bytes(encode_image(frame.image, path))
                images.append(image)
        if not images:
            sources = ", ".join(review.source for review in reviews)
            raise ConfigError(f"{sources}: no counted vehicle was checked")
        with (target / LABELS_NAME).open("wb") as file:
            write_coco_images(file, images)


def _labelled(
    frame: FrameTracks, checked: Mapping[tuple[int, int], str], name: Path, size: Size
) -> ImageTracks:
    """Return the checked vehicles of a frame; everything else in it is ignored.

    `checked` has their classes, by the numbers of frame and track.
    """
    vehicles, ignored, around = [], [], [Box(0, 0, *size)]
    for track in frame.tracks:
        class_name = checked.get((frame.index, track.id))
        if class_name and track.state != "predicted":
            vehicles.append(replace(track, class_name=class_name))
            around = [part for region in around for part in _without(region, track.box)]
        else:
            ignored.append(track.box)
    return ImageTracks(name, size, vehicles, ignored=[*ignored, *around])


def _without(region: Box, box: Box) -> list[Box]:
    """Return the largest parts of a region that do not overlap a box."""
    if not region.intersection(box).area:
        return [region]
    beside = [replace(region, x2=box.x1), replace(region, x1=box.x2)]
    parts = [*beside, replace(region, y2=box.y1), replace(region, y1=box.y2)]
    return [part for part in parts if part.area]
