"""`vdet eval tracks`: compare a file of tracks with the truth."""

from pathlib import Path

import click

from vdet.cli.command import Command
from vdet.cli.messages import progress_steps
from vdet.cli.options import PATH, POSITIVE, print_results, results_options
from vdet.evaluate.output import check_outputs
from vdet.version import __version__


@click.command(
    cls=Command,
    examples=("vdet eval tracks out.txt gt.txt --page page",),
)
@click.argument("prediction", type=PATH, metavar="PRED")
@click.argument("truth", type=PATH, metavar="TRUTH")
@click.option(
    "--until",
    type=POSITIVE,
    metavar="FRAME",
    show_default="the last one in the truth",
    help="End with this frame, counted from 1.",
)
@click.option(
    "--rate",
    type=click.FloatRange(min=0, min_open=True),
    metavar="FPS",
    show_default="from the times in PRED",
    help="Frames per second, for the number of false tracks per minute.",
)
@results_options
@click.pass_obj
def tracks(
    quiet: bool,
    *,
    prediction: Path,
    truth: Path,
    until: int | None,
    rate: float | None,
    json_target: str | None,
    page: Path | None,
    overwrite: bool,
) -> None:
    """Compare a file of tracks with the truth.

    PRED is a file of vdet detect-video --tracks. TRUTH is MOTChallenge gt.txt, KITTI tracking
    labels, CVAT for video 1.1, COCO or YOLO with tracks, or a .csv or .jsonl as vdet writes it.
    """
    from vdet.evaluate.clips.evaluate import score_files
    from vdet.evaluate.clips.page import video_page
    from vdet.evaluate.clips.text import plain_clip, result_lines

    check_outputs(json_target, page, overwrite=overwrite, inputs=[prediction, truth])
    with progress_steps("", quiet=quiet) as steps:
        steps("comparing", None)
        run = score_files(prediction, truth, until=until, rate=rate)
    print_results(
        result_lines([run]),
        plain_clip(run.clips[0]),
        lambda: video_page([run], f"compared with {truth} by vdet {__version__}"),
        json_target=json_target,
        page=page,
        overwrite=overwrite,
    )
