"""`vdet eval patches`: measure the classifier."""

from pathlib import Path

import click

from vdet.cli.command import command
from vdet.cli.messages import progress_steps
from vdet.cli.options import PATH, SettingsChoice, jobs_option, option, settings_options
from vdet.cli.results import Results, results_options


@command(
    "vdet eval patches vehicles.zip non-vehicles.zip --page page",
    "vdet eval patches patches/ --model model.npz",
)
@click.argument("data", nargs=-1, required=True, type=PATH, metavar="DATA...")
@option(
    "--model FILE",
    "Test this model on all of DATA.",
    name="model_path",
    show_default="a new model, tested on the last patches of each folder",
)
@settings_options("train.svm.C=1e-4")
@jobs_option()
@results_options
def patches(
    data: tuple[Path, ...],
    choice: SettingsChoice,
    jobs: int | None,
    results: Results,
) -> None:
    """Measure the classifier on labelled patches.

    Each DATA is a folder or a zip file, as vdet train takes it.
    """
    settings = choice.read(detector="svm")
    from vdet.detect.svm.kind import requested_features, trained_on
    from vdet.detect.svm.model import load_model
    from vdet.evaluate.output import RunName, plain_run, run_lines
    from vdet.learn.svm.dataset import find_patches
    from vdet.learn.svm.patch_eval import evaluate_patches, lines, patch_page, values

    model_path = choice.model_path
    model = load_model(model_path, requested_features(settings.svm)) if model_path else None
    results.check([*data, *([model_path] if model_path else [])])
    files = find_patches(data)
    with progress_steps("") as steps:
        result = evaluate_patches(files, settings, model, jobs=jobs, steps=steps)
    sources = trained_on(model_path) if model_path else ()
    name = RunName("svm", model_path, choice.config_name, choice.assignments, sources)
    results.print(
        [*run_lines(name), *lines(result)],
        plain_run(name) | values(result),
        lambda: patch_page(result, name),
    )
