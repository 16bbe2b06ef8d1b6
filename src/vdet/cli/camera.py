"""`vdet calibrate` and `vdet draw`: the lens of a camera, and its lines and zones."""

from fractions import Fraction
from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import LOG, command, print_lines, progress_bars
from vdet.errors import quantity
from vdet.files import OutputFiles, file_ids, output_errors


@command()
@click.argument("photos", nargs=-1, required=True, type=options.PATH, metavar="PHOTO...")
@options.output_file("-o", "--output", required=True, help="Camera file to write, .yaml.")
@click.option(
    "--pattern",
    type=options.parse_pair,
    metavar="NxM",
    default="9x6",
    help="Inner corners of the board per row and column, 3 to 999.",
)
@options.overwrite_option
def calibrate(
    photos: tuple[Path, ...], output: Path, pattern: tuple[int, int], overwrite: bool
) -> None:
    """Calibrate a camera with photographs of a chessboard.

    Computes its focal length and lens distortion. Each PHOTO is a file, or a folder of files. Take
    ten or more photographs of the whole flat board from different angles.

    \b
    Examples:
      vdet calibrate chessboards/ -o camera.yaml --pattern 9x6
    """
    from vdet.lanes.camera import calibrate as fit
    from vdet.lanes.camera import save_camera
    from vdet.run.images import find_images

    if not (3 <= min(pattern) <= max(pattern) <= 999):
        raise click.UsageError("--pattern: must be 3 to 999 inner corners, such as 9x6")
    paths = list(find_images(photos))
    files = OutputFiles(overwrite=overwrite, inputs=file_ids(paths))
    files.check(output, suffixes=(".yaml", ".yml"), noun="cameras")
    with progress_bars("") as progress:
        progress(f"searching {quantity(len(paths), 'photograph')}", None)
        result = fit(paths, pattern)
    for path, reason in result.skipped.items():
        LOG.warning("%s: not used: %s", path, reason)
    save_camera(result.camera, output, overwrite=overwrite)
    camera, (width, height) = result.camera, result.camera.size
    lens = f"focal length {camera.matrix[0][0]:.0f} px, RMS error {result.rms:.2f} px"
    used = f"{len(result.photos)} of {len(paths)} photographs used"
    print_lines(f"{output}: {width}×{height}, {lens}, {used}")


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
@options.settings_options
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
    from vdet.pages.traffic import Drawing
    from vdet.run.video import Run, read_scene

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
