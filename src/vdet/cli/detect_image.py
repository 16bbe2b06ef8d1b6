"""`vdet detect-image`: find vehicles in images."""

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import LOG, announce, print_lines, progress_bars
from vdet.errors import ImageError, failure_code, quantity
from vdet.files import OutputFiles
from vdet.run.sinks import Output
from vdet.workers import core_count

if TYPE_CHECKING:
    from vdet.run.result import FrameResult


@command()
@click.argument("images", nargs=-1, required=True, type=options.PATH, metavar="IMAGE...")
@options.output_file(
    "-o",
    "--output",
    metavar="PATH",
    help="Write the image with its boxes. For several images, a folder, in which they keep their "
    "names and folders.",
)
@options.output_folder("--stages", help="Write an image of every stage into DIR.")
@options.output_files("--json", help="Write the boxes to FILE. With -, to standard output.")
@options.output_files(
    "--labels", help="Write the boxes for labelling tools: .coco.json. Can be repeated."
)
@options.sinks_option
@options.classes_option
@options.lanes_option
@options.model_option
@options.settings_options(classes="classes", lanes="lanes.enabled", model="detector.model")
@options.overwrite_option
def detect_image(
    images: options.Paths,
    output: Path | None,
    stages: Path | None,
    sinks: tuple[Output, ...],
    source: options.SettingsSource,
    overwrite: bool,
    **paths: options.Paths,
) -> int:
    """Find vehicles in images.

    Each IMAGE is a file, or a folder (searched recursively). Without an output option, prints the
    vehicles: class, score, and box in pixels as x, y, width and height.

    \b
    Examples:
      vdet detect-image road.jpg -o found.jpg --json -
      vdet detect-image images/ -o found/ --labels images.coco.json
      vdet detect-image road.jpg --stages stages
    """
    settings = source.load()
    if settings.lack_of_metres:
        announce(f"vdet: note: {settings.lack_of_metres}")
    from vdet.detect.detectors import load_detector
    from vdet.run.images import ImageSearch, find_images, plan_images, run_images
    from vdet.run.sinks.protocol import STANDARD_OUTPUT, check_sinks

    search = ImageSearch(load_detector(settings.detector), settings)
    paths_below = find_images(images)
    outputs = options.requested_outputs(sinks, paths)
    inputs = source.inputs(*paths_below, settings=settings)
    files = OutputFiles(overwrite=overwrite, inputs=inputs, is_last=True)
    check_sinks(outputs, files)
    jobs = plan_images(paths_below, output, stages, files)
    is_printed = not (output or stages or outputs)
    failed = 0
    results = run_images(jobs, outputs, search, files, threads=core_count())
    with progress_bars(" images") as progress, closing(results):
        advance = progress("", len(jobs))
        for result in results:
            if isinstance(result, ImageError):
                LOG.error("%s", result)
                failed += 1
            elif is_printed:
                _print_vehicles(result)
            advance(1)
    if failed < len(jobs):
        written = (output, stages, *(item.path for item in outputs if item.path != STANDARD_OUTPUT))
        announce(*(f"{path}: written" for path in written if path))
    return failure_code(failed, len(jobs))


def _print_vehicles(result: "FrameResult") -> None:
    rows = []
    for track in result.tracks:
        box = ", ".join(map(str, track.box.xywh))
        rows.append(f"  {track.class_name or 'vehicle':8} {track.score:.2f}  {box}")
    print_lines(f"{result.source}: {quantity(len(rows), 'vehicle')}", *rows)
