"""`vdet detect-video`: find and follow vehicles in one video, or in many."""

import shlex
from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path

import click

from vdet.cli.batch import BatchOptions, batch_options, output_options, process_batch
from vdet.cli.command import Command
from vdet.cli.messages import counted, print_message, progress_steps
from vdet.cli.options import (
    PATH,
    POSITIVE,
    PROCESSES,
    TIME_FORM,
    TimeType,
    check_counts,
    lane_options,
    lines_option,
    model_option,
    output_option,
    overwrite_option,
    read_lanes,
    read_settings,
    read_sinks,
    regions_option,
    settings_options,
    sink_option,
)
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector
from vdet.media.writer import may_replace_video
from vdet.regions import check_mask
from vdet.run.sinks.protocol import Output
from vdet.run.video import VideoJob, check_job, run_video
from vdet.workers import limit_library_threads


@click.command(
    cls=Command,
    examples=(
        "vdet detect-video in.mp4 out.mp4 --tracks out.csv",
        "vdet detect-video in.mp4 --no-video --tracks - --start 1:30 --end 2:00",
        "vdet detect-video in.mp4 --no-video --stages stages --at 12.5",
        "vdet detect-video in.mp4 --no-video --lines lines.yaml --counts counts.csv",
        "vdet detect-video clips/ -d found --tracks .jsonl --skip-existing",
    ),
)
@click.argument("clips", nargs=-1, required=True, type=PATH, metavar="IN [OUT] | CLIP...")
@click.option("--no-video", is_flag=True, help="Write no video, only other outputs.")
@output_option(
    "tracks",
    "FILE",
    "Write the boxes of every frame: .txt (MOTChallenge), .csv, .jsonl, .coco.json, .xml (CVAT), "
    ".kitti.txt or .yolo.zip. With -, they go to standard output as .jsonl. With -d, give only the "
    "ending. Can be repeated.",
)
@output_option(
    "summary",
    "FILE",
    "Write a record of each vehicle: .csv or .json. With -d, give only the suffix. A file over all "
    "videos is then written too.",
)
@output_option(
    "crops",
    "DIR",
    "Write the best picture of each vehicle into DIR. With -d, give an end such as .crops.",
)
@output_option(
    "page",
    "DIR",
    "Write page.html into DIR: a page on the vehicles of the video. With -d, give an ending as in "
    ".page. A page that links all videos is then written too.",
)
@output_option(
    "counts",
    "FILE",
    "Write which vehicles cross the lines and visit the zones of --lines: .csv has the events, "
    ".json also all totals. With -d, give only the end, as in .counts.csv. Can be repeated.",
)
@regions_option
@lines_option
@click.option(
    "--start",
    type=TimeType(),
    metavar=TIME_FORM,
    help="Begin at this time, as in 90, 1:30 or 0:01:30.5.",
)
@click.option("--end", type=TimeType(), metavar=TIME_FORM, help="Stop before this time.")
@click.option("--frames", type=POSITIVE, metavar="N", help="Process at most N frames.")
@click.option(
    "--stride",
    type=click.IntRange(1, 100),
    metavar="N",
    help="Search every N-th frame. In the others, the tracker moves the vehicles on. The same as "
    "--set detector.stride=N.",
)
@click.option(
    "--threads",
    type=PROCESSES,
    metavar="N",
    show_default="one for each core, shared by --jobs",
    help="Search one video in N threads.",
)
@click.option(
    "--stages",
    type=PATH,
    metavar="DIR",
    help="Write a picture of every stage of one frame into DIR. Goes with --at.",
)
@click.option(
    "--at", type=TimeType(), metavar=TIME_FORM, help="Show the frame at this time with --stages."
)
@sink_option
@batch_options
@lane_options
@model_option
@settings_options("output.crf=18")
@overwrite_option
@click.pass_obj
def detect_video(
    quiet: bool,
    *,
    clips: tuple[Path, ...],
    no_video: bool,
    start: Fraction | None,
    end: Fraction | None,
    frames: int | None,
    stride: int | None,
    threads: int | None,
    stages: Path | None,
    at: Fraction | None,
    sinks: tuple[str, ...],
    lanes: bool,
    camera_path: Path | None,
    regions: Path | None,
    lines: Path | None,
    model_path: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
    folder: Path | None,
    jobs: int | None,
    skip_existing: bool,
    dry_run: bool,
    scheduler: str | None,
) -> int:
    """Find and follow vehicles in one video, or in many.

    IN is a video. OUT is written: the same video with a box around each vehicle.

    With -d DIR, every CLIP is processed. A CLIP is a video, a folder with videos in it or below it,
    or a quoted pattern such as 'day*/*.mp4'. The outputs of each video are written into DIR, and a
    record of each into manifest.jsonl there.
    """
    limit_library_threads()
    batch = BatchOptions(folder, jobs, skip_existing, dry_run, scheduler)
    if start is not None and end is not None and end <= start:
        raise click.UsageError("--end must be later than --start")
    others = read_sinks(sinks)
    if folder is None:
        source, output = _in_and_out(clips, batch)
        outputs = _outputs(output, stages, others)
        _check_usage(output, outputs, no_video=no_video, with_stages=stages is not None, at=at)
        batch_outputs = None
    else:
        if stages is not None or at is not None:
            raise click.UsageError("--stages and --at are for one video; leave out -d")
        source, outputs = Path(), ()  # each video has its own
        batch_outputs = output_options(batch, no_video=no_video, others=others, overwrite=overwrite)
    request = read_lanes(lanes, camera_path)
    if stride is not None:
        assignments = (*assignments, f"detector.stride={stride}")
    settings = read_settings(config_name, assignments, model_path, regions=regions, lines=lines)
    check_mask(settings.regions)
    check_counts(others, settings)
    job = VideoJob(source, outputs, start, end, frames, at or Fraction(0), request, overwrite)
    if batch_outputs is not None:
        load_detector(settings.detector, model_path)  # an error is raised before any work
        return process_batch(
            clips,
            job,
            batch_outputs,
            batch,
            settings=settings,
            model=model_path,
            threads=threads,
            quiet=quiet,
        )
    _process_one(job, settings, model_path, threads, quiet=quiet)
    return 0


def _in_and_out(clips: tuple[Path, ...], batch: BatchOptions) -> tuple[Path, Path | None]:
    if batch.need_folder:
        raise click.UsageError("--jobs, --skip-existing, --dry-run and --scheduler go with -d DIR")
    source, *outputs = clips
    if len(outputs) > 1 or (outputs and outputs[0].is_file() and not may_replace_video(outputs[0])):
        shown = shlex.join(map(str, clips[:2])) + (" …" if len(clips) > 2 else "")
        raise click.UsageError(
            f"{outputs[0]} would be the output, and a video that vdet did not write is kept; for "
            f"several videos name a folder: vdet detect-video {shown} -d found"
        )
    return source, outputs[0] if outputs else None


def _outputs(
    video: Path | None, stages: Path | None, others: Sequence[Output]
) -> tuple[Output, ...]:
    named = [("video", video), ("stages", stages)]
    return (*(Output(sink, path) for sink, path in named if path is not None), *others)


def _check_usage(
    video: Path | None,
    outputs: tuple[Output, ...],
    *,
    no_video: bool,
    with_stages: bool,
    at: Fraction | None,
) -> None:
    if no_video == (video is not None):
        raise click.UsageError("give OUT, or --no-video without OUT; or -d DIR for several videos")
    if not outputs:
        raise click.UsageError("nothing would be written; give OUT, --tracks, --stages or --sink")
    if with_stages == (at is None):
        raise click.UsageError("--stages and --at go together")


def _process_one(
    job: VideoJob,
    settings: Settings,
    model_path: Path | None,
    threads: int | None,
    *,
    quiet: bool,
) -> None:
    model = load_detector(settings.detector, model_path)
    check_job(job)
    with progress_steps(" frames", quiet=quiet) as steps:
        steps("opening", None)
        progress = partial(steps, "")
        summary = run_video(job, model, settings, threads=threads, progress=progress)
    if not quiet:
        rate = summary.frames / summary.seconds
        found = f"{counted(summary.frames, 'frame')}, {counted(summary.tracks, 'track')}"
        print_message(f"{job.source}: {found}, {summary.seconds:.1f} s, {rate:.1f} frames/s")
