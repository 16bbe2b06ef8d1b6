"""`vdet draw`: a page for drawing lines over the paths of vehicles."""

from fractions import Fraction
from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_bars
from vdet.errors import quantity
from vdet.files import OutputFiles, output_errors


@command()
@click.argument("clip", type=options.PATH, metavar="CLIP")
@options.output_file(
    "-o",
    "--output",
    required=True,
    help="Page to write, .html, or scene for a survey, .jpg or .png, or .svg with counts.",
)
@options.tracks_from_option()
@options.start_option
@options.end_option
@options.model_option
@options.settings_options(model="detector.model")
@options.overwrite_option
def draw(
    clip: Path,
    output: Path,
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
      vdet draw in.mp4 -c gate.yaml -o scene.jpg
    """
    from vdet.config.loading import given_values
    from vdet.pages.drawing import Drawing
    from vdet.run.scene import read_scene
    from vdet.run.video import Run

    settings = source.load()
    inputs = source.inputs(clip, *([tracks] if tracks else ()), settings=settings)
    files = OutputFiles(overwrite=overwrite, inputs=inputs, is_last=True)
    files.check(output, suffixes=(".html", ".jpg", ".png", ".svg"))
    with progress_bars(" frames") as progress:
        # Without regions, because the page shows their effect.
        whole_frames = settings.model_copy(update={"regions": ()})
        run = Run(clip, settings=whole_frames, start=start, end=end)
        image, scene = read_scene(run, tracks, progress)
    values = given_values(source.configs)
    drawing = Drawing(image, scene.frames, settings, values, scene.findings)
    name = Path([output.name, *source.configs][-1]).with_suffix(".yaml").name
    with files, output_errors(output):
        files.stage(output).write_bytes(drawing.output(output, name))
    print_lines(f"{output}: written, {quantity(len(drawing.paths), 'vehicle')}")
