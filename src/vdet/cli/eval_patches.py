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
    show_default="models that are trained for each split",
    help="Test this model on all of DATA.",
)
@click.option(
    "--split",
    "splits",
    multiple=True,
    type=click.Choice(("random", "tail", "groups")),
    show_default="all three",
    help="Train without the patches of this split, and test on them: random patches, the tail of "
    "each group, or each of the groups in turn. Can be repeated.",
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
    splits: tuple[str, ...],
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
    from vdet.learn.svm.patch_eval import SPLITS, evaluate_model, evaluate_splits
    from vdet.learn.svm.patch_eval.page import patch_page
    from vdet.learn.svm.patch_eval.text import lines, plain

    if model_path is not None and splits:
        raise click.UsageError("--split trains new models; leave it out, or --model")
    settings = read_settings(config_name, assignments, detector="svm")
    model = load_model(model_path, requested_features(settings.svm)) if model_path else None
    inputs = [*data, *([model_path] if model_path else [])]
    check_outputs(json_target, page, overwrite=overwrite, inputs=inputs)
    files = find_patches(data)
    with progress_steps("", quiet=quiet) as steps:
        if model is None:
            chosen = [split for split in SPLITS if split in (splits or SPLITS)]
            result = evaluate_splits(files, settings, chosen, jobs=jobs, steps=steps)
        else:
            result = evaluate_model(files, model, settings, jobs=jobs, steps=steps)
    sources = trained_on(model_path) if model_path else ()
    name = RunName("svm", model_path, config_name, assignments, sources)
    print_results(
        [*run_lines(name), *lines(result)],
        plain_run(name) | plain(result),
        lambda: patch_page(result, name),
        json_target=json_target,
        page=page,
        overwrite=overwrite,
    )
