"""`vdet eval video`: how well vehicles are found and followed in labelled video."""

from pathlib import Path

import click

from vdet.cli.eval_options import give_results, results_options
from vdet.cli.options import PathOf, model_option, read_model, read_settings, settings_options
from vdet.cli.progress import progress_bar
from vdet.evaluate.output import check_outputs
from vdet.resources import shipped_model


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
    help="Compare values of a setting, as in heat.threshold=1,2,4; several make a grid.",
)
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
    loaded = [read_settings(config_name, (*assignments, *extra)) for extra in swept]
    path = model_path or shipped_model(loaded[0].settings.features)
    model, *_ = [read_model(path, each) for each in loaded]  # all fit it, or it says so
    inputs = [*videos, *truths, path]
    check_outputs(json_target, report, overwrite=overwrite, inputs=inputs)
    clips = [open_clip(*pair, until) for pair in zip(videos, truths, strict=True)]
    variants = [Variant(extra, each.settings) for extra, each in zip(swept, loaded, strict=True)]
    with progress_bar(" frames", quiet=quiet) as progress:
        runs = evaluate_clips(clips, model, variants, progress)
    give_results(
        run_lines(runs),
        plain(runs),
        lambda: video_page(runs),
        json_target=json_target,
        report=report,
    )
