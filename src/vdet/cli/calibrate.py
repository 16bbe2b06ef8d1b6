"""`vdet calibrate`: from photographs of a chessboard to a camera file."""

import logging
from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_steps
from vdet.errors import counted

log = logging.getLogger("vdet")


@command()
@click.argument("photos", nargs=-1, required=True, type=options.PATH, metavar="PHOTO...")
@options.output_file_option
@options.option("--pattern NxM", options.parse_pair, default="9x6")
@options.overwrite_option
def calibrate(
    photos: tuple[Path, ...], output: Path, pattern: tuple[int, int], overwrite: bool
) -> None:
    """Calibrate a camera with photographs of a chessboard.

    Computes its focal length and lens distortion. Each PHOTO is a file, or a folder of files. Take
    ten or more photographs of the whole flat board from different angles.

    Parameters
    ----------
    output
        Camera file to write, .yaml.
    pattern
        Inner corners of the board per row and column, 3 to 999.

    Examples
    --------
    vdet calibrate chessboards/ -o camera.yaml --pattern 9x6
    """
    from vdet.lanes.calibration import calibrate as fit
    from vdet.lanes.camera import save_camera
    from vdet.run.images import find_images

    if not (3 <= min(pattern) <= max(pattern) <= 999):
        raise click.UsageError("--pattern: must be 3 to 999 inner corners, such as 9x6")
    found = list(find_images(photos))
    inputs = options.input_files(*found)
    options.check_file(output, ".yaml", ".yml", what="cameras", overwrite=overwrite, inputs=inputs)
    with progress_steps("") as steps:
        steps(f"searching {counted(len(found), 'photograph')}", None)
        result = fit(found, pattern)
    for path, reason in result.skipped.items():
        log.warning("%s: not used: %s", path, reason)
    save_camera(result.camera, output, overwrite=overwrite)
    camera, (width, height) = result.camera, result.camera.size
    lens = f"focal length {camera.matrix[0][0]:.0f} px, RMS error {result.rms:.2f} px"
    used = f"{len(result.photos)} of {len(found)} photographs used"
    print_lines(f"{output}: {width}×{height}, {lens}, {used}")
