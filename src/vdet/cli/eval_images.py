"""`vdet eval images`: measure detection in labelled pictures."""

from functools import partial
from pathlib import Path

import click

from vdet.cli.command import command
from vdet.cli.messages import progress_steps
from vdet.cli.options import PATH, SHARE, SettingsChoice, model_option, option, settings_options
from vdet.cli.results import Results, results_options


@command(
    "vdet eval images pictures/",
    "vdet eval images city/ motorway/ --model their.onnx --least-width 0.03",
)
@click.argument("data", nargs=-1, required=True, type=PATH, metavar="DATA...")
@option(
    "--score SCORE",
    "Count boxes with at least this score, 0 to 1.",
    SHARE,
    show_default="what vdet detect-image shows",
)
@option(
    "--least-width SHARE",
    "Ignore vehicles narrower than this share of the picture's width, 0 to 1.",
    SHARE,
    default=0.0,
)
@settings_options("detector.still_score=0.5", model_option)
@results_options
def images(
    data: tuple[Path, ...],
    score: float | None,
    least_width: float,
    choice: SettingsChoice,
    results: Results,
) -> None:
    """Measure detection in labelled pictures.

    Each DATA is a folder in COCO, KITTI, YOLO or Pascal VOC form, or a COCO file. Each picture is
    searched on its own, and compared with its labels.
    """
    settings = choice.read_for_whole_frames()
    detector = settings.detector
    from vdet.detect.factory import model_file
    from vdet.evaluate.images.evaluate import evaluate_images
    from vdet.evaluate.images.page import images_page
    from vdet.evaluate.images.scores import Counting
    from vdet.evaluate.images.text import lines, plain
    from vdet.evaluate.output import run_name
    from vdet.labels.reading import read_labelled_pictures
    from vdet.labels.roles import Roles
    from vdet.workers import core_count

    model = choice.load_detector(detector.showing_all())
    file = model_file(detector, choice.model_path)
    results.check([*data, *([file] if file else [])])
    roles = Roles.from_settings(settings)
    sets = [read_labelled_pictures(path, roles) for path in data]
    counting = Counting(
        score=detector.shown_score if score is None else score,
        least_width=least_width,
    )
    with progress_steps(" pictures") as steps:
        progress = partial(steps, "")
        result = evaluate_images(sets, model, counting, threads=core_count(), progress=progress)
    run = run_name(detector, choice.model_path, choice.config_name, choice.assignments)
    results.print(lines(result, run), plain(result, run), lambda: images_page(result, run))
