"""`vdet paths`: the picture in which lines are placed."""

from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines
from vdet.cli.watching import Watched, watch_options
from vdet.errors import counted
from vdet.files import check_output


@command(
    "vdet paths in.mp4 -o paths.jpg",
    "vdet paths in.mp4 --tracks-from tracks.jsonl -c gate.yaml -o paths.jpg",
    "vdet paths in.mp4 --no-paths -c gate.yaml -o preview.jpg",
)
@click.argument("clip", type=options.INPUT, metavar="CLIP")
@options.output_file_option("Picture to write, .jpg or .png.")
@options.option("--no-paths", "Search nothing: draw only the grid, lines and zones.")
@watch_options
@options.settings_options("detector.stride=2", options.model_option)
@options.overwrite_option
def paths(
    clip: Path,
    output: Path,
    no_paths: bool,
    watched: Watched,
    choice: options.SettingsChoice,
    overwrite: bool,
) -> None:
    """Draw the paths of all vehicles on one frame, to place lines.

    CLIP is a video or a picture. The paths are coloured by direction: they begin at a dot and end
    at a tip. The grid has pixel coordinates. Lines and zones of the settings are drawn too, with
    the sides of the lines. Where the settings have points of the ground, the grid is in metres on
    the road. In a picture nothing is searched.
    """
    from vdet.lanes.ground import ground_of
    from vdet.media.images import PICTURE_SUFFIXES, is_picture_name, write_image
    from vdet.traffic.borders import place
    from vdet.traffic.paths import draw_grid, draw_ground, draw_paths, draw_places

    settings = choice.read()
    options.check_suffix(output, ".jpg", *sorted(PICTURE_SUFFIXES), what="pictures")
    check_output(output, overwrite=overwrite)
    image = watched.first_image(clip, settings).copy()
    height, width = image.shape[:2]
    lines, zones = place(settings.traffic, width, height)
    settings.camera.check_frames(width, height)
    ground = ground_of(settings.camera, width, height)
    is_still = is_picture_name(clip) and "%" not in clip.name
    if ground:
        draw_ground(image, ground)
    else:
        draw_grid(image)
    found = ""
    if not no_paths and (watched.tracks or not is_still):
        records = watched.records(clip, width, settings)
        draw_paths(image, records)
        found = f", {counted(len(records), 'vehicle')}"
    draw_places(image, lines, zones)
    write_image(output, image, overwrite=overwrite)
    print_lines(f"{output}: {width}×{height}{found}")
