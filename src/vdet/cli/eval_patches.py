"""`vdet eval patches`: measure the classifier."""

from pathlib import Path

import click

from vdet.cli.command import Command
from vdet.cli.messages import progress_steps
from vdet.cli.options import (
    PATH,
    PROCESSES,
    print_results,
    read_settings,
    results_options,
    settings_options,
)
from vdet.detect.svm.kind import requested_features, trained_on
from vdet.detect.svm.model import load_model
from vdet.evaluate.output import RunName, check_outputs, plain_run, run_lines
from vdet.learn.svm.dataset import find_patches


@click.command(
    cls=Command,
    examples=(
        "vdet eval patches vehicles.zip non-vehicles.zip --page page",
        "vdet eval patches patches/ --model model.npz",
    ),
)
@click.argument("data", nargs=-1, required=True, type=PATH, metavar="DATA...")
@click.option(
    "--model",
    "model_path",
    type=PATH,
    metavar="FILE",
    show_default="a new model, tested on the last patches of each folder",
    help="Test this model on all of DATA.",
)
@settings_options("train.svm.C=1e-4")
@click.option(
    "--jobs",
    type=PROCESSES,
    metavar="N",
    show_default="one for each core",
    help="Work in N processes.",
)
@results_options
@click.pass_obj
def patches(
    quiet: bool,
    *,
    data: tuple[Path, ...],
    model_path: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    jobs: int | None,
    json_target: str | None,
    page: Path | None,
    overwrite: bool,
) -> None:
    """Measure the classifier on labelled patches.

    Each DATA is a folder or a zip file, as vdet train takes it.
    """
    from vdet.learn.svm.patch_eval import evaluate_patches, lines, patch_page, values

    settings = read_settings(config_name, assignments, detector="svm")
    model = load_model(model_path, requested_features(settings.svm)) if model_path else None
    inputs = [*data, *([model_path] if model_path else [])]
    check_outputs(json_target, page, overwrite=overwrite, inputs=inputs)
    files = find_patches(data)
    with progress_steps("", quiet=quiet) as steps:
        result = evaluate_patches(files, settings, model, jobs=jobs, steps=steps)
    sources = trained_on(model_path) if model_path else ()
    name = RunName("svm", model_path, config_name, assignments, sources)
    print_results(
        [*run_lines(name), *lines(result)],
        plain_run(name) | values(result),
        lambda: patch_page(result, name),
        json_target=json_target,
        page=page,
        overwrite=overwrite,
    )
