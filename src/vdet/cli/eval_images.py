"""`vdet eval images`: measure detection in labelled pictures."""

from pathlib import Path

import click

from vdet.cli.command import Command
from vdet.cli.messages import progress_bar
from vdet.cli.options import (
    PATH,
    model_option,
    print_results,
    read_whole_frame_settings,
    results_options,
    settings_options,
)
from vdet.detect.factory import load_detector, model_file, trained_on
from vdet.evaluate.output import RunName, check_outputs
from vdet.workers import core_count, limit_library_threads

SHARE = click.FloatRange(0, 1)


@click.command(
    cls=Command,
    examples=(
        "vdet eval images pictures/",
        "vdet eval images city/ motorway/ --model their.onnx --least-width 0.03",
    ),
)
@click.argument("data", nargs=-1, required=True, type=PATH, metavar="DATA...")
@click.option(
    "--score",
    type=SHARE,
    metavar="SCORE",
    show_default="what vdet detect-image shows",
    help="Count boxes with at least this score, 0 to 1.",
)
@click.option(
    "--least-width",
    type=SHARE,
    metavar="SHARE",
    default=0.0,
    show_default=True,
    help="Ignore vehicles narrower than this share of the picture's width, 0 to 1.",
)
@model_option
@settings_options("detector.still_score=0.5")
@results_options
@click.pass_obj
def images(
    quiet: bool,
    *,
    data: tuple[Path, ...],
    score: float | None,
    least_width: float,
    model_path: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    json_target: str | None,
    page: Path | None,
    overwrite: bool,
) -> None:
    """Measure detection in labelled pictures.

    Each DATA is a folder in COCO, KITTI, YOLO or Pascal VOC form, or a COCO file. Each picture is
    searched for itself, and compared with its labels.
    """
    from vdet.evaluate.images.evaluate import evaluate_images
    from vdet.evaluate.images.page import images_page
    from vdet.evaluate.images.scores import Counting
    from vdet.evaluate.images.text import lines, plain
    from vdet.labels.pictures.reading import read_labelled_images

    limit_library_threads()
    detector = read_whole_frame_settings(config_name, assignments, model_path).detector
    model = load_detector(detector.showing_all(), model_path)
    file = model_file(detector, model_path)
    check_outputs(json_target, page, overwrite=overwrite, inputs=[*data, *([file] if file else [])])
    sets = [read_labelled_images(path) for path in data]
    counting = Counting(
        score=detector.shown_score if score is None else score,
        least_width=least_width,
        classes=detector.vehicle_classes,
    )
    with progress_bar(" pictures", quiet=quiet) as progress:
        threads = core_count()
        result = evaluate_images(sets, model, counting, threads=threads, progress=progress)
    run = RunName(detector.kind, file, config_name, assignments, trained_on(detector, file))
    print_results(
        lines(result, run),
        plain(result, run),
        lambda: images_page(result, run),
        json_target=json_target,
        page=page,
        overwrite=overwrite,
    )
