"""`vdet detect-video`: find and follow vehicles in one video, or in many."""

import shlex
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.batch import BatchOptions, batch_options, process_batch, read_suffixes
from vdet.cli.command import command
from vdet.cli.messages import counted, is_quiet, print_message, progress_steps
from vdet.cli.options import option

if TYPE_CHECKING:
    from vdet.config.schema import Settings
    from vdet.run.video import VideoJob


@command(
    "vdet detect-video in.mp4 out.mp4 --tracks out.csv",
    "vdet detect-video in.mp4 --no-video --tracks - --start 1:30 --end 2:00",
    "vdet detect-video in.mp4 --no-video --stages stages --at 12.5",
    "vdet detect-video in.mp4 --no-video --lines lines.yaml --counts counts.csv",
    "vdet detect-video clips/ -d found --tracks .jsonl --skip-existing",
)
@click.argument("clips", nargs=-1, required=True, type=options.PATH, metavar="IN [OUT] | CLIP...")
@option("--no-video", "Write no video, only other outputs.")
@options.output_option(
    "--tracks FILE",
    "Write the boxes of every frame: .txt (MOTChallenge), .csv, .jsonl, .coco.json, .xml "
    "(CVAT), .kitti.txt or .yolo.zip. With -, they go to standard output as .jsonl. With -d, "
    "give only the ending. Can be repeated.",
)
@options.output_option(
    "--vehicles FILE",
    "Write a record of each vehicle: .csv or .json. With -d, give only the ending. A file over "
    "all videos is then written too.",
)
@options.output_option(
    "--crops DIR",
    "Write the best picture of each vehicle into DIR. With -d, give an ending such as .crops.",
)
@options.output_option(
    "--page DIR",
    "Write page.html into DIR: a page on the vehicles of the video. With -d, give an ending "
    "such as .page. A page that links all videos is then written too.",
)
@options.output_option(
    "--counts FILE",
    "Write which vehicles cross the lines and visit the zones of --lines: .csv has the events, "
    ".json also all totals. With -d, give only the ending, as in .counts.csv. Can be repeated.",
)
@options.sink_option
@option(
    f"--start {options.TIME_FORM}",
    "Begin at this time, as in 90, 1:30 or 0:01:30.5.",
    options.parse_time,
)
@option(f"--end {options.TIME_FORM}", "Stop before this time.", options.parse_time)
@option("--frames N", "Process at most N frames.", options.POSITIVE)
@option(
    "--stride N",
    "Search every N-th frame. In the others, the tracker moves the vehicles on. The same as "
    "--set detector.stride=N.",
    click.IntRange(1, 100),
)
@option(
    "--threads N",
    "Search one video in N threads.",
    options.PROCESSES,
    show_default="one for each core, shared by --jobs",
)
@options.output_option(
    "--stages DIR", "Write a picture of every stage of one frame into DIR. Goes with --at."
)
@option(
    f"--at {options.TIME_FORM}", "Show the frame at this time with --stages.", options.parse_time
)
@batch_options
@options.lane_options
@options.settings_options(
    "output.crf=18", options.regions_option, options.lines_option, options.model_option
)
@options.overwrite_option
def detect_video(
    clips: tuple[Path, ...],
    no_video: bool,
    start: Fraction | None,
    end: Fraction | None,
    frames: int | None,
    stride: int | None,
    threads: int | None,
    at: Fraction | None,
    lanes: bool,
    camera: Path | None,
    choice: options.SettingsChoice,
    overwrite: bool,
    batch: BatchOptions,
) -> int:
    """Find and follow vehicles in one video, or in many.

    IN is a video. OUT is written: the same video with a box around each vehicle.

    With -d DIR, every CLIP is processed. A CLIP is a video, a folder with videos in it or below it,
    or a quoted pattern such as 'day*/*.mp4'. The outputs of each video are written into DIR, and a
    record of each into manifest.jsonl there.
    """
    wanted = options.wanted_outputs()
    batch.check(overwrite=overwrite)
    if start is not None and end is not None and end <= start:
        raise click.UsageError("--end must be later than --start")
    if (at is None) == any(sink == "stages" for sink, _ in wanted):
        raise click.UsageError("--stages and --at go together")
    source = Path()
    if batch.folder is None:
        source, video = _in_and_out(clips, no_video=no_video)
        wanted = [*video, *wanted]
    if no_video and not wanted:
        raise click.UsageError("nothing would be written; give an output, such as --tracks")
    request = options.read_lanes(lanes, camera)
    settings = choice.read(*([f"detector.stride={stride}"] if stride else []))
    if not settings.counts and any(sink == "counts" for sink, _ in wanted):
        raise click.UsageError("--counts needs lines or zones; give --lines FILE")
    from vdet.batch.task import Work
    from vdet.regions import check_mask
    from vdet.run.video import VideoJob

    check_mask(settings.regions)
    inputs = (*choice.inputs(settings, settings.detector), *([camera] if camera else []))
    part = start, end, frames, at or Fraction(0)
    job = VideoJob(source, (), *part, request, inputs, overwrite)
    if batch.folder is None:
        job = replace(job, outputs=options.as_outputs(wanted), threads=threads)
        _process_one(job, settings, choice)
        return 0
    suffixes = read_suffixes(wanted, no_video=no_video)
    sinks = {each.sink for each in suffixes}
    work = Work.of(job, sinks, settings, choice.model_path, threads)
    return process_batch(clips, job, suffixes, work, batch)


def _in_and_out(clips: tuple[Path, ...], *, no_video: bool) -> tuple[Path, list[options.Wanted]]:
    source, *outputs = clips
    is_kept = False
    if outputs and outputs[0].is_file():
        from vdet.media.writer import may_replace_video

        is_kept = not may_replace_video(outputs[0])
    if len(outputs) > 1 or is_kept:
        shown = shlex.join(map(str, clips[:2])) + (" …" if len(clips) > 2 else "")
        raise click.UsageError(
            f"{outputs[0]} would be the output, and a video that vdet did not write is kept; "
            f"remove it, or for several videos name a folder: vdet detect-video {shown} -d found"
        )
    if no_video == bool(outputs):
        raise click.UsageError("give OUT, or --no-video without OUT; or -d DIR for several videos")
    return source, [("video", path) for path in outputs]


def _process_one(
    job: "VideoJob",
    settings: "Settings",
    choice: options.SettingsChoice,
) -> None:
    from vdet.run.video import check_job, run_video

    model = choice.load_detector(settings.detector)
    check_job(job)
    with progress_steps(" frames") as steps:
        steps("opening", None)
        totals = run_video(job, model, settings, progress=partial(steps, ""))
    if not is_quiet():
        rate = totals.frames / totals.seconds
        found = f"{counted(totals.frames, 'frame')}, {counted(totals.tracks, 'track')}"
        print_message(f"{job.source}: {found}, {totals.seconds:.1f} s, {rate:.1f} frames/s")
