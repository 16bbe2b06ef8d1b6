"""`vdet calibrate`: from photographs of a chessboard to a camera file."""

from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import LOG, print_lines, progress_bars
from vdet.errors import quantity
from vdet.files import OutputFiles, file_ids


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
    from vdet.lanes.calibration import calibrate as fit
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
