"""`vdet draw`: a page for drawing lines over the paths of vehicles."""

import math
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_steps
from vdet.errors import ConfigError, TruthError, VideoError, counted
from vdet.files import OutputFiles, output_errors
from vdet.progress import Steps

if TYPE_CHECKING:
    from vdet.boxes import Image
    from vdet.media.frame import Frame
    from vdet.run.video import Run
    from vdet.track.track import FrameTracks

_MAX_SAMPLES = 20
"""Maximum number of frames for the image of the scene; at least half of them are used."""
_STILL_FRAMES = 5000
"""Number of frames to read for it if the tracks are known."""
_OUTPUTS, _SETTINGS = (".html", ".jpg", ".png", ".svg"), (".yaml", ".yml")


@command()
@click.argument("clip", type=options.INPUT, metavar="CLIP")
@options.option("-o, --output FILE", options.PATH)
@options.option("--propose FILE", options.PATH)
@options.option(
    "--facing DIRECTION",
    click.Choice(("N", "NE", "E", "SE", "S", "SW", "W", "NW"), case_sensitive=False),
)
@options.option("--tracks-from FILE", name="tracks")
@options.start_option
@options.end_option
@options.settings_options("detector.stride=2", options.model_option)
@options.overwrite_option
def draw(
    clip: Path,
    output: Path | None,
    propose: Path | None,
    facing: str | None,
    tracks: Path | None,
    start: Fraction | None,
    end: Fraction | None,
    overwrite: bool,
) -> None:
    """Write a page for drawing lines and zones over the paths of vehicles.

    CLIP is a video, or with --tracks-from also an image of one frame. The page shows live counts
    for each line, and saves settings for -c. It is one file and needs no network.

    Parameters
    ----------
    output
        Page to write, .html, or image of the scene for a report, .jpg, .png or .svg.
    propose
        Propose a line across each main stream and write the settings, .yaml.
    facing
        Direction of the camera, such as N or SW, for the names of proposed lines.
    tracks
        Read the tracks from FILE instead of detecting vehicles.

    Examples
    --------
    vdet draw in.mp4 -o gate.html
    vdet draw in.mp4 -c gate.yaml -o gate.html --tracks-from tracks.jsonl
    vdet draw in.mp4 --propose gate.yaml
    vdet draw in.mp4 -c gate.yaml -o place.jpg
    """
    from vdet.pages.drawing import Drawing
    from vdet.run.video import Run

    outputs = [path for path in (output, propose) if path]
    settings = options.read_settings()
    if not outputs:
        raise click.UsageError("no output; use -o FILE or --propose FILE")
    for path, suffixes in ((output, _OUTPUTS), (propose, _SETTINGS)):
        if path:
            what = "pages" if path is output else "settings"
            options.check_file(path, *suffixes, what=what, overwrite=overwrite)
    if output and output.suffix.lower() != ".html" and not settings.traffic:
        raise ConfigError(f"{output}: nothing to draw; add lines or zones with -c FILE")
    with progress_steps(" frames") as steps:
        # Without regions, because the page shows their effect.
        run = Run(clip, (), settings.model_copy(update={"regions": ()}), start, end)
        image, frames = _watched(run, tracks, steps)
    settings.camera.check_frames(image.shape[1], image.shape[0])
    drawing = Drawing(image, frames, settings, options.own_values(), facing)
    if propose and not drawing.proposals:
        raise ConfigError(f"{clip}: no stream has enough vehicles; draw lines with -o gate.html")
    with OutputFiles(overwrite=overwrite) as files:
        for path in outputs:
            with output_errors(path):
                name = Path([path.name, *options.config_names()][-1]).with_suffix(".yaml").name
                files.stage(path).write_bytes(drawing.output(path, name))
    lines = drawing.proposals if propose else ()
    print_lines(
        *(f"{path}: {counted(len(drawing.paths), 'vehicle')}" for path in outputs),
        *(f"{line.name}: {counted(line.vehicles, 'vehicle')}" for line in lines),
    )


def _watched(run: "Run", tracks: Path | None, steps: Steps) -> "tuple[Image, list[FrameTracks]]":
    """Return the scene without vehicles, BGR uint8, and the tracks of a video.

    Raises
    ------
    VdetError
        The clip or the file of tracks cannot be used.
    """
    import numpy as np

    from vdet.detect.factory import load_detector
    from vdet.media.images import is_picture_name, read_image
    from vdet.media.reader import VideoReader
    from vdet.run.loop import Parts
    from vdet.run.video import open_video

    clip, settings = run.source, run.settings
    if is_picture_name(clip) and "%" not in clip.name:
        return read_image(clip), _saved(tracks, None, run) if tracks else []
    found: list[FrameTracks] = []

    def frames() -> "Iterator[Frame]":
        if tracks:
            with VideoReader(
                clip, start=run.start, end=run.end, frames=_STILL_FRAMES, settings=settings.input
            ) as reader:
                found.extend(_saved(tracks, float(reader.info.rate), run))
                steps("reading the scene", None)
                yield from reader
            return
        with open_video(run, Parts(load_detector(settings.detector))) as video:
            advance = steps("", video.reader.expected)
            for result in video.results:
                found.append(result.frame_tracks)
                yield result.frame
                advance(1)

    images = _spread(frames())
    if not images:
        raise VideoError(f"{clip}: no frames in this part; check --start and --end")
    return np.median(images, axis=0).astype(np.uint8), found


def _spread(frames: "Iterable[Frame]") -> "list[Image]":
    """Return some of the images, evenly spaced."""
    images, step = list["Image"](), 1
    for number, frame in enumerate(frames):
        if number % step == 0:
            images.append(frame.image)
        if len(images) > _MAX_SAMPLES:
            images, step = images[::2], 2 * step
    return images


def _saved(tracks: Path, rate: float | None, run: "Run") -> "list[FrameTracks]":
    """Return the frames of a file of tracks. Raises `TruthError`."""
    from vdet.labels.reading import read_tracks

    saved = read_tracks(tracks, rate)
    if not saved.has_times:
        raise TruthError(f"{tracks}: has no times; CLIP must be the video")
    start = -math.inf if run.start is None else run.start
    end = math.inf if run.end is None else run.end
    return [frame for frame in saved if start <= frame.time < end]
