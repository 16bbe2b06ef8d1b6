"""`vdet mine`: labelled video to patches."""

from pathlib import Path

import click

from vdet.cli.options import (
    PathOf,
    model_option,
    overwrite_option,
    read_settings,
    settings_options,
)
from vdet.cli.progress import progress_bar
from vdet.detect.factory import model_file
from vdet.errors import OutputError
from vdet.files import check_output


@click.command()
@click.argument("video", type=PathOf())
@click.option(
    "--truth",
    required=True,
    type=PathOf(),
    metavar="FILE",
    help="True boxes: MOTChallenge, KITTI or CVAT.",
)
@click.option("-o", "--output", required=True, type=PathOf(), help="The patches to write, .zip.")
@click.option(
    "--every", type=click.IntRange(min=1), default=4, show_default=True, help="Every n-th frame …"
)
@click.option(
    "--from",
    "first",
    type=click.IntRange(min=1),
    default=1,
    metavar="FRAME",
    help="… from this one on, counted from 1 …",
)
@click.option(
    "--until",
    type=click.IntRange(min=1),
    metavar="FRAME",
    help="… to this one; without it, to the last that the truth knows of.",
)
@model_option
@settings_options
@overwrite_option
@click.pass_obj
def mine(
    quiet: bool,
    *,
    video: Path,
    truth: Path,
    output: Path,
    every: int,
    first: int,
    until: int | None,
    model_path: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
) -> None:
    """Cut patches for vdet train out of VIDEO: vehicles where the truth has them, false alarms.

    Vehicles come with their boxes. A false alarm is a window that the model takes for a vehicle
    where there is none, or only a part of one; nothing is taken from ignore regions.
    """
    from vdet.learn.mining import MiningJob
    from vdet.learn.mining import mine as mine_patches

    if until is not None and until < first:
        raise click.UsageError("--until must not be before --from")
    if output.suffix.lower() != ".zip":
        raise OutputError(f"{output}: patches are written as .zip; name it so")
    settings = read_settings(config_name, assignments)
    file = model_file(settings.detector, model_path)
    inputs = [video, truth, *([file] if file else [])]
    check_output(output, overwrite=overwrite, inputs=inputs)
    job = MiningJob(video, truth, output, every, first, until)
    with progress_bar(" frames", quiet=quiet) as progress:
        mined = mine_patches(job, settings, model_path, progress=progress)
    click.echo(
        f"{output}: {mined.vehicles} patches of vehicles, {mined.boxes} more for their boxes, "
        f"{mined.false_alarms} false alarms, {mined.parts} more on parts of vehicles; "
        f"from {mined.frames} frames"
    )
