"""`vdet mine`: from labelled videos and pictures to patches."""

from pathlib import Path

import click

from vdet.cli.command import Command
from vdet.cli.messages import counted, print_lines, progress_steps
from vdet.cli.options import (
    PATH,
    POSITIVE,
    model_option,
    overwrite_option,
    read_whole_frame_settings,
    settings_options,
)
from vdet.detect.factory import load_detector, model_file
from vdet.errors import OutputError
from vdet.files import check_output


@click.command(
    cls=Command,
    examples=(
        "vdet mine in.mp4 --truth gt.txt -o mined.zip",
        "vdet mine a.mp4 b.mp4 --truth a.txt --truth b.txt pictures/ -o mined.zip",
    ),
)
@click.argument("sources", nargs=-1, required=True, type=PATH, metavar="SOURCE...")
@click.option(
    "--truth",
    "truths",
    multiple=True,
    type=PATH,
    metavar="FILE",
    help="True boxes of a video: MOTChallenge, KITTI, CVAT, COCO, YOLO, .csv or .jsonl. Repeat it "
    "for each video, in their order.",
)
@click.option("-o", "--output", required=True, type=PATH, metavar="FILE", help="Zip file to write.")
@click.option(
    "--every",
    type=POSITIVE,
    default=4,
    show_default=True,
    metavar="N",
    help="Use every Nth frame of a video.",
)
@click.option(
    "--from",
    "first",
    type=POSITIVE,
    default=1,
    show_default=True,
    metavar="FRAME",
    help="Begin at this frame, counted from 1.",
)
@click.option(
    "--until",
    type=POSITIVE,
    metavar="FRAME",
    show_default="the last one in the truth",
    help="End with this frame, counted from 1.",
)
@model_option
@settings_options("train.mine.parts=0")
@overwrite_option
@click.pass_obj
def mine(
    quiet: bool,
    *,
    sources: tuple[Path, ...],
    truths: tuple[Path, ...],
    output: Path,
    every: int,
    first: int,
    until: int | None,
    model_path: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
) -> None:
    """Cut patches for vdet train out of labelled videos and pictures.

    Each SOURCE is a video with a --truth, or labelled pictures: a folder (COCO, KITTI, YOLO or
    Pascal VOC), or a COCO file.

    Vehicles are cut out where the truth has them, and come with their boxes. False alarms are cut
    out too: windows that the model takes for vehicles where there is none, or only a part of one.
    Nothing is cut out of ignore regions.
    """
    from vdet.labels.pictures.reading import holds_labelled_images
    from vdet.learn.svm.mining import MiningJob, PictureSource, VideoSource
    from vdet.learn.svm.mining import mine as mine_patches

    if until is not None and until < first:
        raise click.UsageError("--until must not be before --from")
    if output.suffix.lower() != ".zip":
        raise OutputError(f"{output}: patches are written as .zip; name it so")
    settings = read_whole_frame_settings(config_name, assignments, model_path, detector="svm")
    file = model_file(settings.detector, model_path)
    inputs = [*sources, *truths, *([file] if file else [])]
    check_output(output, overwrite=overwrite, inputs=inputs)
    videos = [path for path in sources if not holds_labelled_images(path)]
    if len(videos) != len(truths):
        raise click.UsageError(f"{len(videos)} videos, {len(truths)} --truth; give one for each")
    labels = dict(zip(videos, truths, strict=True))
    job = MiningJob(
        tuple(
            VideoSource(path, labels[path], every, first, until)
            if path in labels
            else PictureSource(path)
            for path in sources
        ),
        output,
        overwrite,
    )
    detector = load_detector(settings.detector, model_path)
    with progress_steps(" frames", quiet=quiet) as steps:
        mined = mine_patches(job, settings, detector, steps=steps)
    print_lines(
        f"{output}: {mined.vehicles} patches of vehicles, {mined.boxes} more for their boxes, "
        f"{mined.false_alarms} false alarms, {mined.parts} more on parts of vehicles; "
        f"from {counted(mined.frames, 'frame')}"
    )
