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
    read_settings,
    read_sinks,
    settings_options,
    sink_option,
)
from vdet.detect.factory import load_detector
from vdet.pipeline.pictures import find_images, plan_pictures, run_pictures
from vdet.pipeline.sinks.protocol import Output, check_sinks

log = logging.getLogger("vdet")


@click.command()
@click.argument("images", nargs=-1, required=True, type=PathOf(), metavar="IMAGE...")
@click.option(
    "-o", "--output", type=PathOf(), help="Annotated picture, or a folder for several of them."
)
@click.option(
    "--json", "json_target", type=PathOf(), metavar="FILE", help="The boxes; - for standard output."
)
@click.option("--stages", type=PathOf(), metavar="DIR", help="A picture of every stage.")
@sink_option
@lane_options
@model_option
@settings_options
@overwrite_option
def detect_image(
    *,
    images: tuple[Path, ...],
    output: Path | None,
    json_target: Path | None,
    stages: Path | None,
    sinks: tuple[str, ...],
    lanes: bool,
    camera_path: Path | None,
    model_path: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
) -> None:
    """Find vehicles in each IMAGE: files, or folders of them."""
    shared = read_sinks(sinks)
    if json_target is not None:
        shared = (Output("json", json_target), *shared)
    if not (output or stages or shared):
        raise click.UsageError("nothing would be written; give -o, --json, --stages or --sink")
    request = read_lanes(lanes, camera_path)
    settings = read_settings(config_name, assignments)
    model = load_detector(settings.detector, model_path)
    sources = find_images(images)
    check_sinks(shared, overwrite=overwrite, inputs=sources)
    jobs = plan_pictures(sources, output, stages, overwrite=overwrite)
    failures = run_pictures(jobs, shared, model, settings, request)
    if failures:
        *others, last = failures
        for failure in others:
            log.error("%s", failure)
        raise last
