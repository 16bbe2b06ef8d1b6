"""`vdet eval tracks`: how good tracks are that were found before."""

from pathlib import Path

import click

from vdet.cli.eval_options import give_results, results_options
from vdet.cli.options import PathOf
from vdet.evaluate.output import check_outputs


@click.command()
@click.argument("prediction", type=PathOf(), metavar="PRED")
@click.argument("truth", type=PathOf(), metavar="TRUTH")
@click.option(
    "--until", type=click.IntRange(min=1), metavar="FRAME", help="Last frame to look at, from 1."
)
@click.option(
    "--rate",
    type=click.FloatRange(min=0, min_open=True),
    help="Frames a second, for false tracks a minute; without it, as PRED has it.",
)
@results_options
def tracks(
    *,
    prediction: Path,
    truth: Path,
    until: int | None,
    rate: float | None,
    json_target: str | None,
    report: Path | None,
    overwrite: bool,
) -> None:
    """Compare PRED, as vdet detect-video --tracks writes it, with TRUTH.

    TRUTH is a MOTChallenge gt.txt, KITTI tracking labels or CVAT for video 1.1.
    """
    from vdet.evaluate.clips.evaluate import score_files
    from vdet.evaluate.clips.text import plain_clip, run_lines
    from vdet.evaluate.report.video_page import video_page

    check_outputs(json_target, report, overwrite=overwrite, inputs=[prediction, truth])
    run = score_files(prediction, truth, until=until, rate=rate)
    give_results(
        run_lines([run]),
        plain_clip(run.clips[0]),
        lambda: video_page([run]),
        json_target=json_target,
        report=report,
    )
