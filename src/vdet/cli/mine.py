"""`vdet mine`: from labelled video to patches."""

from pathlib import Path

import click

from vdet.cli.command import Command
from vdet.cli.messages import counted, print_lines, progress_bar
from vdet.cli.options import (
    PATH,
    POSITIVE,
    model_option,
    overwrite_option,
    read_whole_frame_settings,
    settings_options,
)
from vdet.detect.factory import model_file
from vdet.errors import OutputError
from vdet.files import check_output


@click.command(
    cls=Command,
    examples=("vdet mine in.mp4 --truth gt.txt -o mined.zip",),
)
@click.argument("video", type=PATH, metavar="VIDEO")
@click.option(
    "--truth",
    required=True,
    type=PATH,
    metavar="FILE",
    help="True boxes: MOTChallenge, KITTI, CVAT, COCO, YOLO, .csv or .jsonl.",
)
@click.option("-o", "--output", required=True, type=PATH, metavar="FILE", help="Zip file to write.")
@click.option(
    "--every",
    type=POSITIVE,
    default=4,
    show_default=True,
    metavar="N",
    help="Use every Nth frame.",
)
@click.option(
    "--from",
    "first",
    type=POSITIVE,
    default=1,
    show_default=True,
    metavar="FRAME",
    help="Begin at this frame, counted from 1.",
)
@click.option(
    "--until",
    type=POSITIVE,
    metavar="FRAME",
    show_default="the last one in the truth",
    help="End with this frame, counted from 1.",
)
@model_option
@settings_options("mining.parts=0")
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
    """Cut patches for vdet train out of labelled video.

    Vehicles are cut out where the truth has them, and come with their boxes. False alarms are cut
    out too: windows that the model takes for vehicles where there is none, or only a part of one.
    Nothing is cut out of ignore regions.
    """
    from vdet.learn.mining import MiningJob
    from vdet.learn.mining import mine as mine_patches

    if until is not None and until < first:
        raise click.UsageError("--until must not be before --from")
    if output.suffix.lower() != ".zip":
        raise OutputError(f"{output}: patches are written as .zip; name it so")
    settings = read_whole_frame_settings(config_name, assignments, model_path)
    file = model_file(settings.detector, model_path)
    inputs = [video, truth, *([file] if file else [])]
    check_output(output, overwrite=overwrite, inputs=inputs)
    job = MiningJob(video, truth, output, every, first, until, overwrite)
    with progress_bar(" frames", quiet=quiet) as progress:
        mined = mine_patches(job, settings, model_path, progress=progress)
    print_lines(
        f"{output}: {mined.vehicles} patches of vehicles, {mined.boxes} more for their boxes, "
        f"{mined.false_alarms} false alarms, {mined.parts} more on parts of vehicles; "
        f"from {counted(mined.frames, 'frame')}"
    )
