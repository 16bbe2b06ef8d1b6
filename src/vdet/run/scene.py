"""The scene that a camera shows, and the tracks of its vehicles, for `vdet draw`."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vdet.boxes import Image
from vdet.errors import TruthError, VideoError
from vdet.findings import Finding, at_places, warnings_in, without
from vdet.labels.label import Size
from vdet.labels.reading import read_tracks
from vdet.media import Frame, VideoInfo
from vdet.media.images import is_image_file, read_image
from vdet.media.reader import VideoReader
from vdet.progress import Progress
from vdet.regions import Regions
from vdet.run.result import findings_in
from vdet.run.video import Run, log, open_video
from vdet.track.track import FrameTracks

_MAX_SAMPLES = 20
"""Maximum number of frames for the image of the scene; at least half of them are used."""
_STILL_FRAMES = 5000
"""Number of frames to read for it if the tracks are saved."""


@dataclass(frozen=True, slots=True)
class SceneTracks:
    """The tracks of the vehicles in a scene, and reasons to doubt them where there are lines."""

    frames: list[FrameTracks]
    findings: tuple[Finding, ...] = ()


def read_scene(run: Run, tracks: Path | None, progress: Progress) -> tuple[Image, SceneTracks]:
    """Return the scene without vehicles, BGR uint8 `(H, W, 3)`, and the tracks of its vehicles.

    The image is the median of frames of the video, or the source if that is an image. There is a
    warning (logger "vdet") for each reason to doubt the tracks.

    Parameters
    ----------
    tracks
        A file of tracks; None: detect the vehicles in the video.

    Raises
    ------
    VdetError
        The source or the file of tracks cannot be used.
    """
    if is_image_file(run.source):
        image = read_image(run.source)
        height, width = image.shape[:2]
        shown = saved_frames(tracks, run, (width, height)) if tracks else SceneTracks([])
    else:
        images, shown = (
            _with_saved_tracks(run, tracks, progress) if tracks else _with_detection(run, progress)
        )
        if not images:
            raise VideoError(f"{run.source}: no frames in this part; check --start and --end")
        image = np.median(images, axis=0).astype(np.uint8)
    for finding in warnings_in(shown.findings):
        log.warning("%s: %s", run.source, finding)
    return image, shown


def _with_saved_tracks(
    run: Run, tracks: Path, progress: Progress
) -> tuple[list[Image], SceneTracks]:
    """Return some of the first images, and all saved tracks."""
    with VideoReader(
        run.source, start=run.start, end=run.end, frames=_STILL_FRAMES, settings=run.settings.input
    ) as reader:
        size = reader.info.width, reader.info.height
        saved = saved_frames(tracks, run, size, reader.info)
        progress("reading the scene", None)
        return _spread(reader), saved


def _with_detection(run: Run, progress: Progress) -> tuple[list[Image], SceneTracks]:
    """Return some of the images, and the tracks of all frames."""
    shown: list[FrameTracks] = []
    with open_video(run, with_traffic=False) as video:
        advance = progress("", video.reader.expected)

        def frames() -> Iterator[Frame]:
            for result in video.results:
                shown.append(result.frame_tracks)
                yield result.frame
                advance(1)

        images, findings = _spread(frames()), findings_in(video.facts)
        return images, SceneTracks(shown, at_places((*findings.items, *findings.facts)))


def _spread(frames: Iterable[Frame]) -> list[Image]:
    """Return some of the images, evenly spaced."""
    images, step = list[Image](), 1
    for number, frame in enumerate(frames):
        if number % step == 0:
            images.append(frame.image)
        if len(images) > _MAX_SAMPLES:
            images, step = images[::2], 2 * step
    return images


def saved_frames(tracks: Path, run: Run, size: Size, video: VideoInfo | None = None) -> SceneTracks:
    """Return the frames of a file of tracks in the part of a run, with the vehicles in its regions.

    `size` is that of the frames, pixels. Without a video, the first frame of the file is the first
    one of the video. Raises `TruthError`, also if the tracks are of frames of another size.
    """
    saved = read_tracks(tracks, float(video.rate) if video else None, size)
    if video and saved.video and saved.video.name != video.name:
        log.warning("%s: is of %s, not %s", tracks, saved.video.name, video.name)
    if not saved.has_times:
        raise TruthError(f"{tracks}: has no times; CLIP must be the video")
    origin = float(video.start) if video else saved.first_time
    start = origin + float(run.start or 0)
    end = math.inf if run.end is None else origin + float(run.end)
    regions = Regions(run.settings.regions, *size)
    frames = [
        replace(frame, tracks=regions.inside(frame.tracks))
        for frame in saved
        if start <= frame.time < end
    ]
    return SceneTracks(frames, without(at_places(saved.findings), run.settings.conditions.ignore))
