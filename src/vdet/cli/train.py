"""`vdet train`: from labelled patches or pictures to a model."""

import tempfile
from pathlib import Path

import click

from vdet.cli.command import Command
from vdet.cli.messages import print_lines, progress_steps
from vdet.cli.options import (
    PATH,
    PROCESSES,
    overwrite_option,
    read_settings,
    scheduler_option,
    settings_options,
)
from vdet.detect.svm.model import save_model
from vdet.errors import OutputError
from vdet.files import check_output
from vdet.learn.svm.dataset import find_boxed, find_patches


@click.command(
    cls=Command,
    examples=(
        "vdet train vehicles.zip non-vehicles.zip mined.zip -o model.npz",
        "vdet train patches/ -o model.npz --set train.svm.C=1e-3",
    ),
)
@click.argument("data", nargs=-1, required=True, type=PATH, metavar="DATA...")
@click.option(
    "-o", "--output", required=True, type=PATH, metavar="FILE", help="Model file to write, .npz."
)
@settings_options("train.svm.C=1e-4")
@click.option(
    "--jobs",
    type=PROCESSES,
    metavar="N",
    show_default="one for each core",
    help="Work in N processes.",
)
@scheduler_option
@overwrite_option
@click.pass_obj
def train(
    quiet: bool,
    *,
    data: tuple[Path, ...],
    output: Path,
    config_name: str | None,
    assignments: tuple[str, ...],
    jobs: int | None,
    scheduler: str | None,
    overwrite: bool,
) -> None:
    """Train a model on labelled patches or pictures.

    Each DATA is a folder or a zip file of patches, or labelled pictures (COCO, KITTI, YOLO or
    Pascal VOC), out of which patches of vehicles and of other things are cut. Patches lie in
    vehicles/<group>/ and non-vehicles/<group>/. A file boxes.csv beside these folders says where in
    a patch the vehicle is; vdet mine writes it. With it the model learns where the sides of
    vehicles are. The metrics are printed, and written beside the model as JSON.
    """
    from vdet.labels.pictures.reading import holds_labelled_images
    from vdet.learn.svm.mining import MiningJob, PictureSource, mine
    from vdet.learn.svm.training import train as fit_model

    if jobs and scheduler:
        raise click.UsageError("--jobs is for this machine; leave it out, or --scheduler")
    settings = read_settings(config_name, assignments, detector="svm")
    if output.suffix.lower() != ".npz":
        raise OutputError(f"{output}: models are written as .npz; name it so")
    metrics_path = output.with_suffix(".json")
    for path in (output, metrics_path):
        check_output(path, overwrite=overwrite, inputs=data)
    if scheduler:  # the workers were started in other folders
        data = tuple(path.absolute() for path in data)
    pictures = [path for path in data if holds_labelled_images(path)]
    patches = [path for path in data if path not in pictures]
    with (
        tempfile.TemporaryDirectory(prefix="vdet-") as folder,
        progress_steps("", quiet=quiet) as steps,
    ):
        if pictures:
            archive = Path(folder) / "pictures.zip"
            sources = tuple(PictureSource(path) for path in pictures)
            mine(MiningJob(sources, archive), settings, None, steps=steps)
            patches.append(archive)
        files, boxed = find_patches(patches), find_boxed(patches)
        model, metrics = fit_model(
            files,
            settings,
            boxed=boxed,
            jobs=jobs,
            scheduler=scheduler,
            steps=steps,
        )
    save_model(model, output, overwrite=overwrite)
    metrics.write(metrics_path, overwrite=overwrite)
    print_lines(*metrics.lines(), "", f"{output}: the model; {metrics_path}: the metrics")
