"""`vdet mine`: from labelled videos and pictures to patches."""

from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_steps
from vdet.errors import counted
from vdet.files import check_output


@command(
    "vdet mine in.mp4 --truth gt.txt -o mined.zip",
    "vdet mine a.mp4 b.mp4 --truth a.txt --truth b.txt pictures/ -o mined.zip",
)
@click.argument("sources", nargs=-1, required=True, type=options.INPUT, metavar="SOURCE...")
@options.truth_option
@options.output_file_option("Zip file to write.")
@options.option("--every N", "Use every N-th frame of a video.", options.POSITIVE, default=4)
@options.option(
    "--from FRAME",
    "Begin at this frame, counted from 1.",
    options.POSITIVE,
    name="first",
    default=1,
)
@options.until_option
@options.settings_options("labels.roles.tram=vehicle", options.model_option)
@options.overwrite_option
def mine(
    sources: tuple[Path, ...],
    truths: tuple[Path, ...],
    output: Path,
    every: int,
    first: int,
    until: int | None,
    choice: options.SettingsChoice,
    overwrite: bool,
) -> None:
    """Cut patches for vdet train out of labelled videos and pictures.

    Each SOURCE is a video with a --truth, or labelled pictures: a folder (COCO, KITTI, YOLO or
    Pascal VOC), or a COCO file.

    Vehicles are cut out where the truth has them, and come with their boxes. False alarms are cut
    out too: windows that the model takes for vehicles where there is none, or only a part of one.
    Nothing is cut out of ignore regions.
    """
    if until is not None and until < first:
        raise click.UsageError("--until must not be before --from")
    options.check_suffix(output, ".zip", what="patches")
    settings = choice.read_for_whole_frames(detector="svm")
    from vdet.detect.svm.kind import load_svm
    from vdet.labels.reading import holds_labelled_pictures
    from vdet.learn.svm import mining

    check_output(output, overwrite=overwrite)
    videos = [path for path in sources if not holds_labelled_pictures(path)]
    if len(videos) != len(truths):
        given = f"videos: {len(videos)}, truths: {len(truths)}"
        raise click.UsageError(f"pass one --truth for each video ({given})")
    labels = dict(zip(videos, truths, strict=True))
    labelled = [
        mining.VideoSource(path, labels[path], every, first, until)
        if path in labels
        else mining.PictureSource(path)
        for path in sources
    ]
    model = load_svm(settings.svm, Path(settings.svm.model) if settings.svm.model else None)
    with progress_steps(" frames") as steps:
        frames, counts = mining.mine(
            labelled, output, settings, model, overwrite=overwrite, steps=steps
        )
    found = f"{counts['vehicle']} patches of vehicles, {counts['box']} more for their boxes"
    alarms = f"{counts['false alarm']} false alarms, {counts['part']} more on parts of vehicles"
    print_lines(f"{output}: {found}, {alarms}; from {counted(frames, 'frame')}")
