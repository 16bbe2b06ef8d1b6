"""`vdet detect-image`: vehicles in pictures."""

import logging
from pathlib import Path

import click

from vdet.cli.options import (
    PathOf,
    lane_options,
    model_option,
    overwrite_option,
    read_lanes,
    read_model,
    read_settings,
    settings_options,
)
from vdet.errors import ImageError
from vdet.files import check_output, write_json
from vdet.pipeline.stills import StillResult, find_images, list_results, plan, process_still

log = logging.getLogger("vdet")


@click.command()
@click.argument("images", nargs=-1, required=True, type=PathOf(), metavar="IMAGE...")
@click.option(
    "-o", "--output", type=PathOf(), help="Annotated picture, or a folder for several of them."
)
@click.option("--json", "json_target", metavar="FILE", help="The boxes; - for standard output.")
@click.option("--stages", type=PathOf(), metavar="DIR", help="A picture of every stage.")
@lane_options
@model_option
@settings_options
@overwrite_option
def detect_image(
    *,
    images: tuple[Path, ...],
    output: Path | None,
    json_target: str | None,
    stages: Path | None,
    lanes: bool,
    camera_path: Path | None,
    model_path: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
) -> None:
    """Find vehicles in each IMAGE: files, or folders of them."""
    if not (output or json_target or stages):
        raise click.UsageError("nothing would be written; give -o, --json or --stages")
    request = read_lanes(lanes, camera_path)
    loaded = read_settings(config_name, assignments)
    model = read_model(model_path, loaded)
    sources = find_images(images)
    if json_target not in (None, "-"):
        check_output(Path(json_target), overwrite=overwrite, inputs=sources)
    jobs = plan(sources, output, stages, overwrite=overwrite)
    results: list[StillResult] = []
    failures: list[ImageError] = []
    for job in jobs:
        try:
            results.append(process_still(job, model, loaded.settings, request))
        except ImageError as error:
            failures.append(error)
    if json_target and results:
        write_json(list_results(results), json_target)
    if failures:
        *others, last = failures
        for failure in others:
            log.error("%s", failure)
        raise last
