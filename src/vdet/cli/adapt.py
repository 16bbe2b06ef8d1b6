"""`vdet adapt`: from footage of a camera to a model that knows it."""

from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.batch.inputs import find_sources
from vdet.cli.command import Command
from vdet.cli.messages import print_lines, progress_steps
from vdet.cli.options import (
    PATH,
    PROCESSES,
    model_option,
    overwrite_option,
    read_settings,
    read_whole_frame_settings,
    settings_options,
)
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector, model_file
from vdet.detect.svm.model import load_model, save_model
from vdet.errors import DataError, OutputError
from vdet.files import check_output
from vdet.workers import core_count

if TYPE_CHECKING:
    from vdet.learn.adapt.run import NamedDetector

_TRUTH = "truth"


@click.command(
    cls=Command,
    examples=(
        "vdet adapt clips/ -o mycamera.npz",
        "vdet adapt clips/ -o mycamera.npz --minutes 3 --teacher their.onnx",
    ),
)
@click.argument("clips", nargs=-1, required=True, type=PATH, metavar="CLIP...")
@click.option(
    "-o", "--output", required=True, type=PATH, metavar="FILE", help="Model to write, .npz."
)
@click.option(
    "--teacher",
    metavar="FILE",
    show_default="the shipped network",
    help="Model file of the detector whose detections are learnt, .onnx or .npz. With truth, the "
    "labels given with --truth are learnt instead.",
)
@click.option(
    "--truth",
    "truths",
    multiple=True,
    type=PATH,
    metavar="FILE",
    help="True boxes of a video, to check the models with. Repeat it for each CLIP, in the same "
    "order.",
)
@click.option(
    "--minutes",
    type=click.FloatRange(0, 10_000, min_open=True),
    metavar="M",
    help="Watch so many minutes in all, from the start of each CLIP.",
)
@click.option(
    "--jobs",
    type=PROCESSES,
    metavar="N",
    show_default="one for each core",
    help="Work in N processes.",
)
@model_option
@settings_options("adapt.rounds=2")
@overwrite_option
@click.pass_obj
def adapt(
    quiet: bool,
    *,
    clips: tuple[Path, ...],
    output: Path,
    teacher: str | None,
    truths: tuple[Path, ...],
    minutes: float | None,
    jobs: int | None,
    model_path: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
) -> None:
    """Adapt the linear model to a camera.

    Each CLIP is a video, or a folder of videos, all of one camera. A slow and thorough detector,
    the teacher, watches them. The linear model (--model) learns what it finds, and is checked on
    the last part of each CLIP. It is written only if it finds more there than before, with a report
    beside it as JSON.
    """
    from vdet.evaluate.truth import read_truth
    from vdet.learn.adapt.run import AdaptJob, adapt_model

    settings = read_whole_frame_settings(config_name, assignments)
    if output.suffix.lower() != ".npz":
        raise OutputError(f"{output}: models are written as .npz; name it so")
    paths = [source.path for source in find_sources(clips)]
    if truths and len(truths) != len(paths):
        raise click.UsageError(f"{len(paths)} videos, {len(truths)} --truth; give one for each")
    if teacher == _TRUTH and not truths:
        raise click.UsageError("--teacher truth learns from labels; give them with --truth")
    report_path = output.with_suffix(".json")
    base_path = model_file(settings.svm, model_path)
    assert base_path is not None  # the linear model has a file
    for path in (output, report_path):
        check_output(path, overwrite=overwrite, inputs=[*paths, *truths, base_path])
    job = AdaptJob(
        tuple(paths),
        None if minutes is None else Fraction(minutes) * 60 / len(paths),
        tuple(read_truth(path) for path in truths),
    )
    base = load_model(base_path)
    taught_by = None if teacher == _TRUTH else _teacher(teacher)
    with progress_steps("", quiet=quiet) as steps:
        model, report = adapt_model(
            *(job, base, taught_by, settings), threads=jobs or core_count(), jobs=jobs, steps=steps
        )
    print_lines(*report.lines())
    if report.gain <= 0:
        raise DataError(
            f"{output}: is not written: in the frames kept back, the adapted model is no better "
            f"than {base_path.name}; give more footage, or footage with more vehicles"
        )
    save_model(model, output, overwrite=overwrite)
    report.write(report_path, overwrite=overwrite)
    print_lines("", f"{output}: the model; {report_path}: the report")


def _teacher(name: str | None) -> "NamedDetector":
    """Load the teacher; a model file of the form .npz is a linear model, others are networks."""
    from vdet.learn.adapt.run import NamedDetector

    path = None if name is None else Path(name)
    is_linear = path is not None and path.suffix.lower() == ".npz"
    settings = (Settings() if is_linear else read_settings("net", ())).detector.showing_all()
    file = model_file(settings, path)
    return NamedDetector(file.name if file else settings.kind, load_detector(settings, path))
