"""`vdet detect-image`: find vehicles in images."""

import logging
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_steps
from vdet.errors import ImageError, counted, failure_code
from vdet.workers import IMAGES, core_count, return_freed_memory

if TYPE_CHECKING:
    from vdet.run.result import FrameResult

log = logging.getLogger("vdet")


@command()
@click.argument("images", nargs=-1, required=True, type=options.PATH, metavar="IMAGE...")
@options.option("-o, --output PATH", options.PATH)
@options.option("--stages DIR")
@options.output_option("--json FILE")
@options.output_option("--labels FILE")
@options.sink_option
@options.class_option
@options.lanes_option
@options.settings_options("detector.min_score_still=0.5", options.model_option)
@options.overwrite_option
def detect_image(
    images: tuple[Path, ...], output: Path | None, stages: Path | None, overwrite: bool
) -> int:
    """Find vehicles in images.

    Each IMAGE is a file, or a folder (searched recursively). Without an output option, prints the
    vehicles: class, score, and box in pixels as x, y, width and height.

    Parameters
    ----------
    output
        Write the image with its boxes. For several images, a folder, in which they keep their names
        and folders.
    stages
        Write an image of every stage into DIR.
    json
        Write the boxes to FILE. With -, to standard output.
    labels
        Write the boxes for labelling tools: .coco.json or .yolo.zip. Can be repeated.

    Examples
    --------
    vdet detect-image road.jpg
    vdet detect-image road.jpg -o found.jpg --json -
    vdet detect-image images/ -o found/ --json boxes.json
    vdet detect-image images/ --labels images.coco.json
    vdet detect-image road.jpg --stages stages
    """
    settings = options.read_settings()
    if settings.lack_of_metres:
        log.warning("%s", settings.lack_of_metres)
    from vdet.detect.factory import load_detector
    from vdet.regions import check_masks
    from vdet.run.images import ImageSearch, find_images, plan_images, run_images
    from vdet.run.sinks.protocol import check_sinks

    return_freed_memory(*IMAGES)
    check_masks(settings.regions)
    model = load_detector(settings.detector)
    sources = find_images(images)
    shared = options.wanted_outputs()
    inputs = options.input_files(*sources, settings=settings)
    check_sinks(shared, overwrite=overwrite, inputs=inputs)
    jobs = plan_images(sources, output, stages, overwrite=overwrite, inputs=inputs)
    is_printed, failed = not (output or stages or shared), 0
    search, threads = ImageSearch(model, settings), core_count()
    results = run_images(jobs, shared, search, overwrite=overwrite, inputs=inputs, threads=threads)
    with progress_steps(" images") as steps, closing(results):
        advance = steps("", len(jobs))
        for result in results:
            if isinstance(result, ImageError):
                log.error("%s", result)
                failed += 1
            elif is_printed:
                _print_vehicles(result)
            advance(1)
    return failure_code(failed, len(jobs))


def _print_vehicles(result: "FrameResult") -> None:
    rows = []
    for track in result.tracks:
        box = ", ".join(map(str, track.box.xywh))
        rows.append(f"  {track.class_name or 'vehicle':8} {track.score:.2f}  {box}")
    print_lines(f"{result.source}: {counted(len(rows), 'vehicle')}", *rows)
