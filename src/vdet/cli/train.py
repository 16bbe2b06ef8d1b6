"""`vdet train`: patches to a model."""

from pathlib import Path

import click

from vdet.cli.options import (
    PathOf,
    overwrite_option,
    read_settings,
    scheduler_option,
    settings_options,
)
from vdet.cli.progress import progress_bar
from vdet.detect.svm.model import save_model
from vdet.errors import OutputError
from vdet.files import check_output
from vdet.learn.dataset import find_boxed, find_patches


@click.command()
@click.argument("data", nargs=-1, required=True, type=PathOf(), metavar="DATA...")
@click.option("-o", "--output", required=True, type=PathOf(), help="The model to write, .npz.")
@settings_options
@click.option("--jobs", type=click.IntRange(min=1), help="Processes; else one a core.")
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
    """Train a model on DATA: folders or zip files of labelled patches.

    Patches lie in vehicles/<group>/ and non-vehicles/<group>/. Where a boxes.csv beside these
    folders tells where in a patch the vehicle is, as in those of vdet mine, the model learns to
    find its sides. The report is printed, and written beside the model as JSON.
    """
    from vdet.learn.training import train as fit_model

    if jobs and scheduler:
        raise click.UsageError("--jobs is for this machine; leave it out, or --scheduler")
    settings = read_settings(config_name, assignments)
    if output.suffix.lower() != ".npz":
        raise OutputError(f"{output}: models are written as .npz; name it so")
    report_path = output.with_suffix(".json")
    for path in (output, report_path):
        check_output(path, overwrite=overwrite, inputs=data)
    if scheduler:  # the workers stand in other folders
        data = tuple(path.absolute() for path in data)
    files, boxed = find_patches(data), find_boxed(data)
    with progress_bar(" patches", quiet=quiet) as start:
        model, report = fit_model(
            files,
            settings,
            boxed=boxed,
            jobs=jobs,
            scheduler=scheduler,
            progress=start(len(files) + len(boxed)),
        )
    save_model(model, output)
    report.write(report_path)
    click.echo("\n".join(report.lines()))
    click.echo(f"\n{output}: the model; {report_path}: the report")
