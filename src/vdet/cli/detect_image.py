"""`vdet detect-image`: find vehicles in pictures."""

import logging
from pathlib import Path

import click
from tqdm import tqdm

from vdet.cli.command import Command
from vdet.cli.messages import counted, print_lines, progress_bar
from vdet.cli.options import (
    PATH,
    lane_options,
    model_option,
    overwrite_option,
    read_lanes,
    read_settings,
    read_sinks,
    regions_option,
    settings_options,
    sink_option,
)
from vdet.detect.factory import load_detector
from vdet.errors import failure_code
from vdet.regions import check_mask
from vdet.run.pictures import find_images, plan_pictures, run_pictures
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import Output, check_sinks
from vdet.workers import limit_library_threads

log = logging.getLogger("vdet")


@click.command(
    cls=Command,
    examples=(
        "vdet detect-image road.jpg",
        "vdet detect-image road.jpg -o found.jpg --json -",
        "vdet detect-image pictures/ -o found/ --json boxes.json",
        "vdet detect-image road.jpg --stages stages",
    ),
)
@click.argument("images", nargs=-1, required=True, type=PATH, metavar="IMAGE...")
@click.option(
    "-o",
    "--output",
    type=PATH,
    metavar="PATH",
    help="Write the picture with its boxes. For several pictures, give a folder.",
)
@click.option(
    "--json",
    "json_target",
    type=PATH,
    metavar="FILE",
    help="Write the boxes to FILE, or with - to standard output.",
)
@click.option("--stages", type=PATH, metavar="DIR", help="Write a picture of every stage into DIR.")
@regions_option
@sink_option
@lane_options
@model_option
@settings_options("detector.still_score=0.5")
@overwrite_option
@click.pass_obj
def detect_image(
    quiet: bool,
    *,
    images: tuple[Path, ...],
    output: Path | None,
    json_target: Path | None,
    stages: Path | None,
    sinks: tuple[str, ...],
    lanes: bool,
    camera_path: Path | None,
    regions: Path | None,
    model_path: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
) -> int:
    """Find vehicles in pictures.

    Each IMAGE is a file, or a folder of files. Without an output, the vehicles are printed: class,
    score, and box in pixels, as x, y, width and height.
    """
    limit_library_threads()
    shared = read_sinks(sinks)
    if json_target is not None:
        shared = (Output("json", json_target), *shared)
    is_printed = not (output or stages or shared)
    request = read_lanes(lanes, camera_path)
    settings = read_settings(config_name, assignments, model_path, regions=regions)
    check_mask(settings.regions)
    model = load_detector(settings.detector, model_path)
    sources = find_images(images)
    check_sinks(shared, overwrite=overwrite, inputs=sources)
    jobs = plan_pictures(sources, output, stages, overwrite=overwrite)
    with progress_bar(" pictures", quiet=quiet) as progress:
        failures = run_pictures(
            jobs,
            shared,
            model,
            settings,
            request,
            overwrite=overwrite,
            progress=progress,
            on_result=_print_vehicles if is_printed else lambda _: None,
        )
    for failure in failures:
        log.error("%s", failure)
    return failure_code(len(failures), len(jobs))


def _print_vehicles(result: FrameResult) -> None:
    rows = [
        f"  {track.class_name or 'vehicle':8} {track.score:.2f}  "
        f"{track.box.x}, {track.box.y}, {track.box.width}, {track.box.height}"
        for track in result.tracks
    ]
    with tqdm.external_write_mode():  # a progress bar moves below
        print_lines(f"{result.source}: {counted(len(rows), 'vehicle')}", *rows)
