"""`vdet eval video`: measure detection and tracking in labelled video."""

from pathlib import Path

import click

from vdet.cli.command import Command
from vdet.cli.messages import progress_bar
from vdet.cli.options import (
    PATH,
    POSITIVE,
    model_option,
    print_results,
    read_sinks,
    read_whole_frame_settings,
    results_options,
    settings_options,
    sink_option,
)
from vdet.detect.factory import load_detector, model_file, trained_on
from vdet.evaluate.output import RunName, check_outputs, run_lines
from vdet.run.sinks.protocol import check_sinks
from vdet.workers import limit_library_threads


@click.command(
    cls=Command,
    examples=(
        "vdet eval video in.mp4 --truth gt.txt --page page",
        "vdet eval video in.mp4 --truth gt.txt --sweep tracker.needed=0.1,0.3",
    ),
)
@click.argument("videos", nargs=-1, required=True, type=PATH, metavar="IN...")
@click.option(
    "--truth",
    "truths",
    multiple=True,
    required=True,
    type=PATH,
    metavar="FILE",
    help="True boxes of a video: MOTChallenge, KITTI, CVAT, COCO, YOLO, .csv or .jsonl. Repeat it "
    "for each IN, in the same order.",
)
@click.option(
    "--until",
    type=POSITIVE,
    metavar="FRAME",
    show_default="the last one in the truth",
    help="End with this frame, counted from 1.",
)
@click.option(
    "--sweep",
    "sweeps",
    multiple=True,
    metavar="KEY=VALUE,VALUE",
    help="Compare values of one setting, for example tracker.needed=0.1,0.3. Repeated, all "
    "combinations are compared.",
)
@sink_option
@model_option
@settings_options("tracker.needed=0.3")
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
    page: Path | None,
    overwrite: bool,
) -> None:
    """Measure detection and tracking in labelled video.

    Vehicles are found and followed in each video IN, and compared with its truth.
    """
    from vdet.evaluate.clips.clip import Variant, open_clip
    from vdet.evaluate.clips.evaluate import evaluate_clips
    from vdet.evaluate.clips.page import video_page
    from vdet.evaluate.clips.sweep import grid, with_values_in_force
    from vdet.evaluate.clips.text import plain, result_lines

    limit_library_threads()
    if len(videos) != len(truths):
        raise click.UsageError(f"{len(videos)} videos, {len(truths)} --truth; give one for each")
    base = read_whole_frame_settings(config_name, assignments, model_path)
    swept = grid(with_values_in_force(sweeps, base))
    outputs = read_sinks(sinks)
    if outputs and (len(swept) > 1 or len(videos) > 1):
        raise click.UsageError("--sink is for one video under one setting; leave out the others")
    variants = []
    for extra in swept:
        settings = read_whole_frame_settings(config_name, (*assignments, *extra), model_path)
        variants.append(Variant(settings, load_detector(settings.detector, model_path), extra))
    detectors = [variant.settings.detector for variant in variants]
    files = [path for each in detectors if (path := model_file(each, model_path))]
    inputs = [*videos, *truths, *files]
    check_outputs(json_target, page, overwrite=overwrite, inputs=inputs)
    check_sinks(outputs, overwrite=overwrite, inputs=inputs)
    clips = [open_clip(*pair, until) for pair in zip(videos, truths, strict=True)]
    with progress_bar(" frames", quiet=quiet) as progress:
        runs = evaluate_clips(clips, variants, progress, outputs=outputs, overwrite=overwrite)
    first = variants[0].settings.detector
    file = model_file(first, model_path)
    name = RunName(first.kind, file, config_name, assignments, trained_on(first, file))
    print_results(
        [*run_lines(name), *result_lines(runs)],
        plain(runs, name),
        lambda: video_page(runs, "; ".join(run_lines(name))),
        json_target=json_target,
        page=page,
        overwrite=overwrite,
    )
