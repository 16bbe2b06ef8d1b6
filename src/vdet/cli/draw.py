"""`vdet draw`: a page for drawing lines over the paths of vehicles."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_steps
from vdet.errors import ConfigError, counted
from vdet.files import OutputFiles, output_errors

_DIRECTIONS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


@command()
@click.argument("clip", type=options.INPUT, metavar="CLIP")
@options.output_file(
    "-o",
    "--output",
    help="Page to write, .html, or image of the scene for a report, .jpg, .png or .svg.",
)
@options.output_file(
    "--propose", help="Propose a line across each main stream and write the settings, .yaml."
)
@click.option(
    "--facing",
    type=click.Choice(_DIRECTIONS, case_sensitive=False),
    metavar="DIRECTION",
    help="Direction of the camera, such as N or SW, for the names of proposed lines.",
)
@options.input_file(
    "--tracks-from", "tracks", help="Read the tracks from FILE instead of detecting vehicles."
)
@options.start_option
@options.end_option
@options.model_option
@options.settings_options(model="detector.model")
@options.overwrite_option
def draw(
    clip: Path,
    output: Path | None,
    propose: Path | None,
    facing: str | None,
    tracks: Path | None,
    start: Fraction | None,
    end: Fraction | None,
    source: options.SettingsSource,
    overwrite: bool,
) -> None:
    """Write a page for drawing lines over the paths of vehicles.

    CLIP is a video, or an image of one frame, which has paths only with --tracks-from. Zones can be
    drawn too. The page shows live counts for each line, and saves settings for -c. It needs no
    network.

    \b
    Examples:
      vdet draw in.mp4 -o gate.html
      vdet draw in.mp4 -c gate.yaml -o gate.html --tracks-from tracks.jsonl
      vdet draw in.mp4 --propose gate.yaml
      vdet draw in.mp4 -c gate.yaml -o scene.jpg
    """
    from vdet.pages.drawing import Drawing
    from vdet.run.scene import read_scene
    from vdet.run.video import Run

    outputs = [path for path in (output, propose) if path]
    settings = source.load()
    if not outputs:
        raise click.UsageError("no output; use -o FILE or --propose FILE")
    inputs = source.inputs(clip, *([tracks] if tracks else ()), settings=settings)
    if output:
        suffixes = (".html", ".jpg", ".png", ".svg")
        options.check_file(output, *suffixes, noun="pages", overwrite=overwrite, inputs=inputs)
        if output.suffix.lower() != ".html" and not settings.traffic:
            raise ConfigError(f"{output}: nothing to draw; add lines or zones with -c FILE")
    if propose:
        options.check_file(
            propose, ".yaml", ".yml", noun="settings", overwrite=overwrite, inputs=inputs
        )
    with progress_steps(" frames") as steps:
        # Without regions, because the page shows their effect.
        whole_frames = settings.model_copy(update={"regions": ()})
        run = Run(clip, settings=whole_frames, start=start, end=end)
        image, frames = read_scene(run, tracks, steps)
    drawing = Drawing(image, frames, settings, _user_values(source.configs), facing)
    if propose and not drawing.proposals:
        raise ConfigError(f"{clip}: no stream has enough vehicles; draw lines with -o gate.html")
    with OutputFiles(overwrite=overwrite) as files:
        for path in outputs:
            with output_errors(path):
                name = Path([path.name, *source.configs][-1]).with_suffix(".yaml").name
                files.stage(path).write_bytes(drawing.output(path, name))
    lines = drawing.proposals if propose else ()
    print_lines(
        *(f"{path}: written, {counted(len(drawing.paths), 'vehicle')}" for path in outputs),
        *(f"{line.name}: {counted(line.vehicles, 'vehicle')}" for line in lines),
    )


def _user_values(configs: Sequence[str]) -> dict[str, Any]:
    """Return the values of the settings files that are not shipped: see `given_values`."""
    from vdet.config.loading import find_config, given_values, shipped_configs

    paths = [find_config(name) for name in configs]
    return given_values([path for path in paths if path not in shipped_configs().values()])
