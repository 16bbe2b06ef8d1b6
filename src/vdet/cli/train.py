"""`vdet train`: from labelled patches to a linear model."""

from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_steps
from vdet.files import check_output


@command(
    "vdet train vehicles.zip non-vehicles.zip mined.zip -o model.npz",
    "vdet train patches/ -o model.npz --set train.svm.C=1e-3",
)
@click.argument("data", nargs=-1, required=True, type=options.INPUT, metavar="DATA...")
@options.output_file_option("Model file to write, .npz.")
@options.settings_options("train.svm.C=1e-4")
@options.jobs_option("Describe patches in N threads.")
@options.overwrite_option
def train(
    data: tuple[Path, ...],
    output: Path,
    choice: options.SettingsChoice,
    jobs: int | None,
    overwrite: bool,
) -> None:
    """Train a linear model on labelled patches.

    Each DATA is a folder or a zip file with pictures in vehicles/<group>/ and
    non-vehicles/<group>/. A file boxes.csv beside these folders says where in a patch the vehicle
    is; vdet mine writes it. With it the model learns where the sides of vehicles are. The metrics
    are printed, and written beside the model as JSON.
    """
    settings = choice.read(detector="svm")
    options.check_suffix(output, ".npz", what="models")
    metrics_path = output.with_suffix(".json")
    for path in (output, metrics_path):
        check_output(path, overwrite=overwrite)
    from vdet.detect.svm.model import save_model
    from vdet.learn.svm.dataset import find_patches
    from vdet.learn.svm.training import train as fit_model

    files = find_patches(data)
    with progress_steps("") as steps:
        model, metrics = fit_model(files, settings, jobs=jobs, steps=steps)
    save_model(model, output, overwrite=overwrite)
    metrics.write(metrics_path, overwrite=overwrite)
    print_lines(*metrics.lines(), "", f"{output}: the model; {metrics_path}: the metrics")
