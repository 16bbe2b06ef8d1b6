"""`vdet eval patches`: how well the classifier works."""

from pathlib import Path

import click

from vdet.cli.eval_options import give_results, results_options
from vdet.cli.options import PathOf, read_settings, settings_options
from vdet.cli.progress import progress_bar
from vdet.detect.svm.kind import requested_features
from vdet.detect.svm.model import load_model
from vdet.evaluate.output import check_outputs
from vdet.learn.dataset import find_patches


@click.command()
@click.argument("data", nargs=-1, required=True, type=PathOf(), metavar="DATA...")
@click.option(
    "--model",
    "model_path",
    type=PathOf(),
    metavar="FILE",
    help="Test this model on all of DATA; without it, models are trained afresh for each split.",
)
@click.option(
    "--split",
    "splits",
    multiple=True,
    type=click.Choice(("random", "tail", "groups")),
    help="Only this split; may be given often. groups: leave one group out.",
)
@settings_options
@click.option("--jobs", type=click.IntRange(min=1), help="Processes; else one a core.")
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
    report: Path | None,
    overwrite: bool,
) -> None:
    """Measure the classifier on DATA: folders or zip files of labelled patches."""
    from vdet.learn.patch_eval import SPLITS, evaluate_model, evaluate_splits
    from vdet.learn.patch_eval.page import patch_page
    from vdet.learn.patch_eval.text import lines, plain

    if model_path is not None and splits:
        raise click.UsageError("--split trains afresh; leave it out, or --model")
    settings = read_settings(config_name, assignments)
    model = load_model(model_path, requested_features(settings.svm)) if model_path else None
    inputs = [*data, *([model_path] if model_path else [])]
    check_outputs(json_target, report, overwrite=overwrite, inputs=inputs)
    files = find_patches(data)
    with progress_bar("", quiet=quiet) as progress:
        if model is None:
            chosen = [split for split in SPLITS if split in (splits or SPLITS)]
            result = evaluate_splits(files, settings, chosen, jobs=jobs, progress=progress)
        else:
            result = evaluate_model(files, model, settings, jobs=jobs, progress=progress)
    give_results(
        lines(result),
        plain(result),
        lambda: patch_page(result),
        json_target=json_target,
        report=report,
    )
