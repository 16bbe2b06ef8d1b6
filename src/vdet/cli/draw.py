"""`vdet draw`: a page for drawing lines over the paths of vehicles."""

from fractions import Fraction
from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_steps
from vdet.errors import ConfigError, counted
from vdet.files import OutputFiles, output_errors

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

    CLIP is a video, or an image of one frame, which has paths only with --tracks-from. The page
    shows live counts for each line, and saves settings for -c. It needs no network.

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
    from vdet.run.scene import read_scene
    from vdet.run.video import Run

    outputs = [path for path in (output, propose) if path]
    settings = options.read_settings()
    if not outputs:
        raise click.UsageError("no output; use -o FILE or --propose FILE")
    for path, suffixes, what in ((output, _OUTPUTS, "pages"), (propose, _SETTINGS, "settings")):
        if path:
            options.check_file(path, *suffixes, what=what, overwrite=overwrite)
    if output and output.suffix.lower() != ".html" and not settings.traffic:
        raise ConfigError(f"{output}: nothing to draw; add lines or zones with -c FILE")
    with progress_steps(" frames") as steps:
        # Without regions, because the page shows their effect.
        run = Run(clip, (), settings.model_copy(update={"regions": ()}), start, end)
        image, frames = read_scene(run, tracks, steps)
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
        *(f"{path}: written, {counted(len(drawing.paths), 'vehicle')}" for path in outputs),
        *(f"{line.name}: {counted(line.vehicles, 'vehicle')}" for line in lines),
    )
