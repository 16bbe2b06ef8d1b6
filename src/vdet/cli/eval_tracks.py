"""`vdet eval tracks`: compare a file of tracks with the truth."""

from pathlib import Path

import click

from vdet.cli.command import command
from vdet.cli.messages import progress_steps
from vdet.cli.options import PATH, RATE, SettingsChoice, option, settings_options, until_option
from vdet.cli.results import Results, results_options
from vdet.version import __version__


@command(
    "vdet eval tracks out.txt gt.txt --page page",
)
@click.argument("prediction", type=PATH, metavar="PRED")
@click.argument("truth", type=PATH, metavar="TRUTH")
@until_option
@option(
    "--rate FPS",
    "Frames per second, for the number of false tracks per minute.",
    RATE,
    show_default="from the times in PRED",
)
@settings_options("labels.roles.motorcycle=vehicle")
@results_options
def tracks(
    prediction: Path,
    truth: Path,
    until: int | None,
    rate: float | None,
    choice: SettingsChoice,
    results: Results,
) -> None:
    """Compare a file of tracks with the truth.

    PRED is a file of vdet detect-video --tracks. TRUTH is MOTChallenge gt.txt, KITTI tracking
    labels, CVAT for video 1.1, COCO or YOLO with tracks, or a .csv or .jsonl of vdet.
    """
    from vdet.evaluate.clips.evaluate import score_files
    from vdet.evaluate.clips.page import video_page
    from vdet.evaluate.clips.text import plain_clip, result_lines
    from vdet.labels.roles import Roles

    roles = Roles.from_settings(choice.read())
    results.check([prediction, truth])
    with progress_steps("") as steps:
        steps("comparing", None)
        run = score_files(prediction, truth, roles, until=until, rate=rate)
    results.print(
        result_lines([run]),
        plain_clip(run.clips[0]),
        lambda: video_page([run], f"compared with {truth} by vdet {__version__}"),
    )
