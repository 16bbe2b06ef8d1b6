"""`vdet calibrate`: from photographs of a chessboard to a camera file."""

import logging
import re
from pathlib import Path
from typing import Any

import click

from vdet.cli.command import Command
from vdet.cli.messages import counted, print_lines, progress_steps
from vdet.cli.options import PATH, overwrite_option
from vdet.errors import OutputError
from vdet.files import check_output
from vdet.lanes.calibration import Pattern, check_previews, write_previews
from vdet.lanes.calibration import calibrate as fit_camera
from vdet.lanes.camera_file import save_camera
from vdet.run.pictures import find_images

log = logging.getLogger("vdet")


class PatternType(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.4 on
    """The inner corners of a chessboard, along and across: 9x6."""

    name = "pattern"

    def convert(
        self, value: Any, param: click.Parameter | None, context: click.Context | None
    ) -> Pattern:
        """Return both numbers."""
        if isinstance(value, tuple):
            return value[0], value[1]
        match = re.fullmatch(r"([0-9]{1,3})[x×]([0-9]{1,3})", value)
        if not match or min(int(n) for n in match.groups()) < 3:
            self.fail(
                f"{value!r} is no pattern; give the inner corners of the board, 3 or more along "
                "and across, as in 9x6",
                param,
                context,
            )
        return int(match[1]), int(match[2])


@click.command(
    cls=Command,
    examples=(
        "vdet calibrate chessboards/ -o camera.yaml",
        "vdet calibrate chessboards/ -o camera.yaml --pattern 9x6 --preview previews",
    ),
)
@click.argument("photos", nargs=-1, required=True, type=PATH, metavar="PHOTO...")
@click.option(
    "-o", "--output", required=True, type=PATH, metavar="FILE", help="Camera file to write, .yaml."
)
@click.option(
    "--pattern",
    default="9x6",
    show_default=True,
    type=PatternType(),
    help="Inner corners of the board, along and across.",
)
@click.option(
    "--preview",
    type=PATH,
    metavar="DIR",
    help="Write every photograph into DIR, with its corners, and undistorted.",
)
@overwrite_option
@click.pass_obj
def calibrate(
    quiet: bool,
    *,
    photos: tuple[Path, ...],
    output: Path,
    pattern: Pattern,
    preview: Path | None,
    overwrite: bool,
) -> None:
    """Measure a camera with photographs of a chessboard.

    Its focal length and lens distortion are computed. Each PHOTO is a file, or a folder of files.
    Take ten or more, of the whole flat board, from different sides.
    """
    if output.suffix.lower() not in (".yaml", ".yml"):
        raise OutputError(f"{output}: cameras are written as .yaml; name it so")
    found = find_images(photos)
    check_output(output, overwrite=overwrite, inputs=found)
    if preview:
        check_previews(preview, found, overwrite=overwrite)
    with progress_steps("", quiet=quiet) as steps:
        steps(f"searching {counted(len(found), 'photograph')}", None)
        calibration = fit_camera(found, pattern)
    for skip in calibration.skipped:
        log.warning("%s: not used: %s", skip.path, skip.reason)
    save_camera(calibration.camera, output, overwrite=overwrite)
    if preview:
        write_previews(preview, calibration, pattern, overwrite=overwrite)
    camera = calibration.camera
    print_lines(
        f"{output}: {camera.width}×{camera.height}, focal length {camera.focal[0]:.0f} px, "
        f"RMS error {camera.rms:.2f} px, {len(calibration.photos)} of {len(found)} photographs used"
    )
