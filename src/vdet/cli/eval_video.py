"""`vdet eval video`: how well vehicles are found and followed in labelled video."""

from pathlib import Path

import click

from vdet.cli.eval_options import give_results, results_options
from vdet.cli.options import (
    PathOf,
    model_option,
    read_settings,
    read_sinks,
    settings_options,
    sink_option,
)
from vdet.cli.progress import progress_bar
from vdet.detect.factory import load_detector, model_file
from vdet.evaluate.output import check_outputs
from vdet.pipeline.sinks.protocol import check_sinks


@click.command()
@click.argument("videos", nargs=-1, required=True, type=PathOf(), metavar="IN...")
@click.option(
    "--truth",
    "truths",
    multiple=True,
    required=True,
    type=PathOf(),
    metavar="FILE",
    help="True boxes: MOTChallenge, KITTI or CVAT; one for each IN, in the same order.",
)
@click.option(
    "--until",
    type=click.IntRange(min=1),
    metavar="FRAME",
    help="Last frame to look at, from 1; without it, the last that the truth knows of.",
)
@click.option(
    "--sweep",
    "sweeps",
    multiple=True,
    metavar="KEY=VALUE,VALUE",
    help="Compare values of a setting, as in detector.heat.threshold=1,2; several make a grid.",
)
@sink_option
@model_option
@settings_options
@results_options
@click.pass_obj
def video(
    quiet: bool,
    *,
    videos: tuple[Path, ...],
    truths: tuple[Path, ...],
    until: int | None,
    sweeps: tuple[str, ...],
    sinks: tuple[str, ...],
    model_path: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    json_target: str | None,
    report: Path | None,
    overwrite: bool,
) -> None:
    """Find and follow vehicles in each IN, and compare them with the truth."""
    from vdet.evaluate.clips.clip import open_clip
    from vdet.evaluate.clips.evaluate import Variant, evaluate_clips
    from vdet.evaluate.clips.sweep import grid
    from vdet.evaluate.clips.text import plain, run_lines
    from vdet.evaluate.report.video_page import video_page

    if len(videos) != len(truths):
        raise click.UsageError(f"{len(videos)} videos, {len(truths)} --truth; give one for each")
    swept = grid(sweeps)
    outputs = read_sinks(sinks)
    if outputs and (len(swept) > 1 or len(videos) > 1):
        raise click.UsageError("--sink is for one video under one setting; leave out the others")
    settings = [read_settings(config_name, (*assignments, *extra)) for extra in swept]
    for each in settings:
        load_detector(each.detector, model_path)  # all fit the model, or it says so
    files = [path for each in settings if (path := model_file(each.detector, model_path))]
    inputs = [*videos, *truths, *files]
    check_outputs(json_target, report, overwrite=overwrite, inputs=inputs)
    check_sinks(outputs, overwrite=overwrite, inputs=inputs)
    clips = [open_clip(*pair, until) for pair in zip(videos, truths, strict=True)]
    variants = [Variant(extra, each) for extra, each in zip(swept, settings, strict=True)]
    with progress_bar(" frames", quiet=quiet) as progress:
        runs = evaluate_clips(clips, model_path, variants, progress, outputs=outputs)
    give_results(
        run_lines(runs),
        plain(runs),
        lambda: video_page(runs),
        json_target=json_target,
        report=report,
    )
