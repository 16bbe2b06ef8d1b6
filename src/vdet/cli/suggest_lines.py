"""`vdet suggest-lines`: a file of lines across the main streams."""

from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines
from vdet.cli.watching import Watched, watch_options
from vdet.errors import ConfigError, counted, escaped
from vdet.files import check_output, write_whole


@command(
    "vdet suggest-lines in.mp4 -o gate.yaml",
    "vdet suggest-lines in.mp4 --tracks-from tracks.jsonl -o gate.yaml",
)
@click.argument("clip", type=options.INPUT, metavar="CLIP")
@options.output_file_option("Settings with the lines, .yaml, for -c.")
@watch_options
@options.settings_options("detector.stride=2", options.model_option)
@options.overwrite_option
def suggest_lines(
    clip: Path,
    output: Path,
    watched: Watched,
    choice: options.SettingsChoice,
    overwrite: bool,
) -> None:
    """Propose lines across the main streams of a clip.

    CLIP is a video, or with --tracks-from also a picture of its frames. Each stream gets a line
    where it comes in and one where it goes out. Look at them with vdet paths, then rename and move
    them.
    """
    from vdet.traffic.suggestions import suggest_lines as suggest

    settings = choice.read()
    options.check_suffix(output, ".yaml", ".yml", what="lines")
    check_output(output, overwrite=overwrite)
    height, width = watched.first_image(clip, settings).shape[:2]
    records = watched.records(clip, width, settings)
    lines = suggest(records, width, height)
    if not lines:
        raise ConfigError(f"{clip}: no vehicle moves far enough; draw a line by hand")
    text = [
        f"# Lines across the main streams of {escaped(clip.name)}, proposed by vdet suggest-lines",
        f"# from {counted(len(records), 'vehicle')}. Look at them, then rename and move them:",
        "# vdet paths CLIP --no-paths -c THIS_FILE -o preview.jpg",
        "# The stream crosses a line to the left of someone who looks from its start to its end.",
        f"camera: {{size: [{width}, {height}]}}",
        "traffic:",
        "  lines:",
    ]
    for line in lines:
        (ax, ay), (bx, by) = line.start, line.end
        ends = f"start: [{ax:g}, {ay:g}], end: [{bx:g}, {by:g}]"
        text.append(f"    # {counted(line.vehicles, 'vehicle')}, going {line.way} in the picture")
        text.append(f"    - {{name: {line.name}, {ends}, left: along, right: against}}")
    write_whole(output, "\n".join([*text, ""]), overwrite=overwrite)
    print_lines(f"{output}: {counted(len(lines), 'line')}, {counted(len(records), 'vehicle')}")
