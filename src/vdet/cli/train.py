"""`vdet train`: from labelled patches to a linear model."""

import json
from dataclasses import asdict
from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_steps
from vdet.files import OutputFiles, check_output, output_errors, write_text


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
    are printed, and written beside the model as model.npz.json.
    """
    settings = choice.read(detector="svm")
    options.check_suffix(output, ".npz", what="models")
    metrics_path = output.with_name(f"{output.name}.json")
    for path in (output, metrics_path):
        check_output(path, overwrite=overwrite)
    from vdet.detect.svm.model import save_model
    from vdet.learn.svm.dataset import find_patches
    from vdet.learn.svm.training import train as fit_model

    files = find_patches(data)
    with progress_steps("") as steps:
        model, metrics = fit_model(files, settings, jobs=jobs, steps=steps)
    with OutputFiles(overwrite=overwrite) as outputs:
        with output_errors(output):
            save_model(model, outputs.stage(output))
        with output_errors(metrics_path):
            write_text(outputs.stage(metrics_path), json.dumps(asdict(metrics), indent=2) + "\n")
    print_lines(*metrics.lines(), "", f"{output}: the model; {metrics_path}: the metrics")
