"""The scene that a camera shows, and the tracks of its vehicles, for `vdet draw`."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from vdet.boxes import Image
from vdet.errors import VideoError
from vdet.findings import at_places, warnings_in
from vdet.media import Frame
from vdet.media.images import is_image_file, read_image
from vdet.media.reader import VideoReader
from vdet.progress import Progress
from vdet.run.steps import findings_in
from vdet.run.video import Results, Run, SceneTracks, log, saved_tracks
from vdet.track.track import FrameTracks

_MAX_SAMPLES = 20
"""Maximum number of frames for the image of the scene; at least half of them are used."""
_STILL_FRAMES = 5000
"""Number of frames to read for it if the tracks are saved."""


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
        shown = saved_tracks(tracks, run, (width, height)) if tracks else SceneTracks([])
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
        saved = saved_tracks(tracks, run, size, reader.info)
        progress("reading the scene", None)
        return _spread(reader), saved


def _with_detection(run: Run, progress: Progress) -> tuple[list[Image], SceneTracks]:
    """Return some of the images, and the tracks of all frames."""
    shown: list[FrameTracks] = []
    with Results(run, with_traffic=False) as results:
        advance = progress("", results.reader.expected)

        def frames() -> Iterator[Frame]:
            for result in results:
                shown.append(result.frame_tracks)
                yield result.frame
                advance(1)

        images, findings = _spread(frames()), findings_in(results.facts)
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
