"""`vdet draw`: a page in which lines are drawn over the paths of vehicles."""

import math
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_steps
from vdet.errors import ConfigError, TruthError, VideoError, counted
from vdet.files import OutputFiles, check_output, output_errors
from vdet.progress import Steps

if TYPE_CHECKING:
    from vdet.boxes import Image
    from vdet.config.schema import Settings
    from vdet.media.frame import Frame
    from vdet.track.track import FrameTracks

_MAX_SAMPLES = 30
"""Number of frames that the picture of the place is made of; at least half as many."""
_STILL_FRAMES = 5000
"""Number of frames of the video that are read for it where the tracks are known."""
_ROWS = 64
"""Rows of the frames of which the median is taken at once."""


@command(
    "vdet draw in.mp4 -o gate.html",
    "vdet draw in.mp4 -c gate.yaml -o gate.html --tracks-from tracks.jsonl",
    "vdet draw in.mp4 --propose gate.yaml",
    "vdet draw in.mp4 -c gate.yaml -o place.jpg",
)
@click.argument("clip", type=options.INPUT, metavar="CLIP")
@options.option(
    "-o, --output FILE",
    "Page to write, .html, or picture of the place for a report, .jpg, .png or .svg.",
    options.PATH,
)
@options.option(
    "--propose FILE", "Write settings with a line across each main stream, .yaml.", options.PATH
)
@options.option(
    "--facing DIRECTION",
    "Where the camera looks, as in N or SW, to name proposed lines.",
    click.Choice(("N", "NE", "E", "SE", "S", "SW", "W", "NW"), case_sensitive=False),
)
@options.option("--tracks-from FILE", "Take the vehicles from this file of tracks.", name="tracks")
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
    choice: options.SettingsChoice,
    overwrite: bool,
) -> None:
    """Draw where vehicles are counted, in a page with their paths.

    CLIP is a video, or with --tracks-from also a picture of its frames. The page shows at once what
    a line counts, and saves settings for -c. It is one file and needs no network.
    """
    from vdet.pages.drawing import Drawing

    outputs = [path for path in (output, propose) if path]
    settings = choice.read()
    _check(output, propose, settings, overwrite)
    with progress_steps(" frames") as steps:
        image, frames = _watched(clip, tracks, settings, (start, end), steps)
    settings.camera.check_frames(image.shape[1], image.shape[0])
    drawing = Drawing(image, frames, settings, choice.given(), facing)
    if propose and not drawing.proposals:
        raise ConfigError(f"{clip}: no stream has enough vehicles; draw lines with -o gate.html")
    with OutputFiles(overwrite=overwrite) as files:
        for path in outputs:
            with output_errors(path):
                name = Path((choice.configs or [path.name])[-1]).with_suffix(".yaml").name
                files.stage(path).write_bytes(drawing.output(path, name))
    print_lines(
        *(f"{path}: {counted(len(drawing.paths), 'vehicle')}" for path in outputs),
        *(f"{line.name}: {counted(line.vehicles, 'vehicle')}" for line in drawing.proposals),
    )


def _check(
    output: Path | None, propose: Path | None, settings: "Settings", overwrite: bool
) -> None:
    """Refuse outputs before any work. Raises `VdetError`, `click.UsageError`."""
    if output:
        options.check_suffix(output, ".html", ".jpg", ".png", ".svg", what="pages")
        check_output(output, overwrite=overwrite)
        if output.suffix.lower() != ".html" and not settings.traffic:
            raise ConfigError(f"{output}: has nothing to show; add lines or zones with -c FILE")
    if propose:
        options.check_suffix(propose, ".yaml", ".yml", what="settings")
        check_output(propose, overwrite=overwrite)
    if not (output or propose):
        raise click.UsageError("there is nothing to write; use -o FILE or --propose FILE")


_Part = tuple[Fraction | None, Fraction | None]
"""The part of the clip that is used: start and end, seconds."""


def _watched(
    clip: Path, tracks: Path | None, settings: "Settings", part: _Part, steps: Steps
) -> "tuple[Image, list[FrameTracks]]":
    """Return the place, BGR uint8, without the vehicles of a video, and their tracks.

    Raises
    ------
    VdetError
        The clip or the file of tracks cannot be used.
    """
    from vdet.detect.factory import load_detector
    from vdet.media.images import is_picture_name, read_image
    from vdet.media.reader import VideoReader
    from vdet.run.video import Run, open_video

    if is_picture_name(clip) and "%" not in clip.name:
        return read_image(clip), _saved(tracks, None, part) if tracks else []
    still, found = _Still(), list["FrameTracks"]()
    if tracks:
        start, end = part
        with VideoReader(
            clip, start=start, end=end, frames=_STILL_FRAMES, settings=settings.input
        ) as reader:
            advance = steps("the place", reader.expected)
            for frame in reader:
                still.add(frame)
                advance(1)
        return still.image(clip), _saved(tracks, float(reader.info.rate), part)
    # All vehicles: the page shows what regions leave out.
    run = Run(clip, (), settings.model_copy(update={"regions": ()}), *part)
    with open_video(run, load_detector(settings.detector)) as video:
        advance = steps("", video.reader.expected)
        for result in video.results:
            still.add(result.frame)
            found.append(result.frame_tracks)
            advance(1)
    return still.image(clip), found


def _saved(tracks: Path, rate: float | None, part: _Part) -> "list[FrameTracks]":
    """Return the frames of a file of tracks. Raises `TruthError`."""
    from vdet.labels.reading import read_tracks

    saved = read_tracks(tracks, rate)
    if not saved.has_times:
        raise TruthError(f"{tracks}: has no times; CLIP must be the video")
    start, end = part[0] or -math.inf, part[1] or math.inf
    return [frame for frame in saved if start <= frame.time < end]


class _Still:
    """The median of some frames that are spread over a video: it shows no vehicle that moves."""

    def __init__(self) -> None:
        self._images: list[Image] = []
        self._step, self._number = 1, 0

    def add(self, frame: "Frame") -> None:
        """Look at the next frame."""
        if self._number % self._step == 0:
            self._images.append(frame.image)
            if len(self._images) > _MAX_SAMPLES:
                self._images, self._step = self._images[::2], 2 * self._step
        self._number += 1

    def image(self, clip: Path) -> "Image":
        """Return it, BGR uint8. Raises `VideoError` where there was no frame."""
        import numpy as np

        if not self._images:
            raise VideoError(f"{clip}: has no frame in this part; check --start")
        strips = [
            np.sort([image[top : top + _ROWS] for image in self._images], axis=0)
            for top in range(0, len(self._images[0]), _ROWS)
        ]
        return np.concatenate([strip[len(strip) // 2] for strip in strips])
