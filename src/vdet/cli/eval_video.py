"""`vdet eval video`: measure detection and tracking in labelled video."""

from functools import partial
from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import progress_steps
from vdet.cli.options import option
from vdet.cli.results import Results, results_options


@command(
    "vdet eval video in.mp4 --truth gt.txt --page page",
    "vdet eval video in.mp4 --truth gt.txt --sweep tracker.needed=0.1,0.3",
)
@click.argument("videos", nargs=-1, required=True, type=options.PATH, metavar="IN...")
@options.truth_option
@options.until_option
@option(
    "--sweep KEY=VALUE,VALUE",
    "Compare values of one setting, for example tracker.needed=0.1,0.3. Repeated, all "
    "combinations are compared.",
    name="sweeps",
    multiple=True,
)
@options.sink_option
@options.settings_options("tracker.needed=0.3", options.model_option)
@results_options
def video(
    videos: tuple[Path, ...],
    truths: tuple[Path, ...],
    until: int | None,
    sweeps: tuple[str, ...],
    choice: options.SettingsChoice,
    results: Results,
) -> None:
    """Measure detection and tracking in labelled video.

    Vehicles are found and followed in each video IN, and compared with its truth.
    """
    if len(videos) != len(truths):
        raise click.UsageError(f"{len(videos)} videos, {len(truths)} --truth; give one for each")
    base = choice.read_for_whole_frames()
    from vdet.detect.factory import model_file
    from vdet.evaluate.clips.clip import Variant, open_clip
    from vdet.evaluate.clips.evaluate import evaluate_clips
    from vdet.evaluate.clips.page import video_page
    from vdet.evaluate.clips.sweep import grid, with_values_in_force
    from vdet.evaluate.clips.text import plain, result_lines
    from vdet.evaluate.output import run_lines, run_name
    from vdet.labels.roles import Roles
    from vdet.run.sinks.protocol import check_sinks

    swept = grid(with_values_in_force(sweeps, base))
    outputs = options.as_outputs(options.wanted_outputs())
    if outputs and (len(swept) > 1 or len(videos) > 1):
        raise click.UsageError("--sink is for one video under one setting; leave out the others")
    variants = []
    for extra in swept:
        settings = choice.read_for_whole_frames(*extra)
        model = choice.load_detector(settings.detector)
        variants.append(Variant(settings, model, extra))
    detectors = [variant.settings.detector for variant in variants]
    files = [path for each in detectors if (path := model_file(each, choice.model_path))]
    inputs = [*videos, *truths, *files]
    results.check(inputs)
    check_sinks(outputs, overwrite=results.overwrite, inputs=inputs)
    roles = Roles.from_settings(base)
    clips = [open_clip(*pair, until, roles) for pair in zip(videos, truths, strict=True)]
    with progress_steps(" frames") as steps:
        runs = evaluate_clips(
            clips, variants, partial(steps, ""), outputs=outputs, overwrite=results.overwrite
        )
    name = run_name(detectors[0], choice.model_path, choice.config_name, choice.assignments)
    results.print(
        [*run_lines(name), *result_lines(runs)],
        plain(runs, name),
        lambda: video_page(runs, "; ".join(run_lines(name))),
    )
