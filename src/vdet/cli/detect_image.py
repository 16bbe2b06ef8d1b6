"""`vdet detect-image`: find vehicles in pictures."""

import logging
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli.command import Command
from vdet.cli.messages import counted, print_message, progress_steps
from vdet.cli.options import (
    PATH,
    LaneChoice,
    SettingsChoice,
    as_outputs,
    lane_options,
    model_option,
    output_option,
    overwrite_option,
    regions_option,
    settings_options,
    sink_option,
    wanted_outputs,
)
from vdet.errors import failure_code

if TYPE_CHECKING:
    from vdet.run.result import FrameResult

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
@click.option("--stages", type=PATH, metavar="DIR", help="Write a picture of every stage into DIR.")
@output_option("json", "FILE", "Write the boxes to FILE, or with - to standard output.")
@sink_option
@lane_options
@settings_options("detector.still_score=0.5", regions_option, model_option)
@overwrite_option
@click.pass_obj
def detect_image(
    quiet: bool,
    *,
    images: tuple[Path, ...],
    output: Path | None,
    stages: Path | None,
    lanes: LaneChoice,
    choice: SettingsChoice,
    overwrite: bool,
) -> int:
    """Find vehicles in pictures.

    Each IMAGE is a file, or a folder of files. Without an output, the vehicles are printed: class,
    score, and box in pixels, as x, y, width and height.
    """
    request = lanes.read()
    settings = choice.read()
    from vdet.regions import check_mask
    from vdet.run.pictures import find_images, plan_pictures, run_pictures
    from vdet.run.sinks.protocol import check_sinks

    check_mask(settings.regions)
    model = choice.load_detector(settings.detector)
    sources = find_images(images)
    shared = as_outputs(wanted_outputs())
    check_sinks(shared, overwrite=overwrite, inputs=sources)
    jobs = plan_pictures(sources, output, stages, overwrite=overwrite)
    is_printed = not (output or stages or shared)
    with progress_steps(" pictures", quiet=quiet) as steps:
        failures = run_pictures(
            jobs,
            shared,
            model,
            settings,
            request,
            overwrite=overwrite,
            progress=partial(steps, ""),
            on_result=_print_vehicles if is_printed else lambda _: None,
        )
    for failure in failures:
        log.error("%s", failure)
    return failure_code(len(failures), len(jobs))


def _print_vehicles(result: "FrameResult") -> None:
    rows = [
        f"  {track.class_name or 'vehicle':8} {track.score:.2f}  "
        f"{track.box.x}, {track.box.y}, {track.box.width}, {track.box.height}"
        for track in result.tracks
    ]
    print_message(f"{result.source}: {counted(len(rows), 'vehicle')}", *rows, err=False)
