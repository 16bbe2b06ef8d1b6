"""`vdet detect-video`: find and follow vehicles in one video or many."""

import logging
import re
import shlex
from contextlib import closing
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import announce, print_lines, progress_steps
from vdet.cli.results import check_counting, counting_options
from vdet.errors import DOUBTFUL, counted, failure_code
from vdet.run.sinks import Output
from vdet.workers import DaskCluster, LocalProcesses, Workers, core_count

if TYPE_CHECKING:
    from vdet.batch.manifest import Record
    from vdet.batch.run import Plan
    from vdet.run.video import Run

log = logging.getLogger("vdet")

_SUFFIX = re.compile(r"(\.[a-z0-9_-]+)+", re.ASCII)
"""The ending of an output's name, such as `.csv` or `.cars.csv`."""


@command()
@click.argument("videos", nargs=-1, required=True, type=options.PATH, metavar="IN [OUT] | CLIP...")
@options.option("--no-video")
@options.output_option("--tracks FILE")
@options.output_option("--vehicles FILE")
@options.output_option("--crops DIR")
@options.output_option("--page DIR")
@options.output_option("--clips DIR")
@options.short_form("--margin SECONDS", "clips.margin", float)
@options.short_form("--exact", "clips.exact")
@counting_options
@options.sink_option
@options.start_option
@options.end_option
@options.option("--frames N", options.POSITIVE)
@options.short_form("--stride N", "detector.stride", click.IntRange(1, 100))
@options.option("--threads N", options.PROCESSES, show_default="one per core, shared by --jobs")
@options.output_option("--stages DIR")
@options.class_option
@options.option(f"--at {options.TIME_FORM}", options.parse_time)
@options.option("--strict")
@options.option("-d, --directory DIR", name="folder")
@options.jobs_option
@options.option("--skip-existing")
@options.option("--dry-run")
@options.scheduler_option
@options.lanes_option
@options.settings_options("output.crf=18", options.model_option)
@options.overwrite_option
def detect_video(
    videos: tuple[Path, ...],
    no_video: bool,
    start: Fraction | None,
    end: Fraction | None,
    frames: int | None,
    threads: int | None,
    at: Fraction | None,
    strict: bool,
    folder: Path | None,
    jobs: int | None,
    skip_existing: bool,
    dry_run: bool,
    scheduler: str | None,
    overwrite: bool,
) -> int:
    """Find and follow vehicles in one video or many.

    IN is a video. OUT is a copy of it with a box around each vehicle. Without any output, OUT is
    beside IN, named in.vdet.mp4.

    With -d DIR, every CLIP is processed. A CLIP is a video, a folder (searched recursively), or a
    quoted pattern such as 'day*/*.mp4'. The outputs go into DIR, with a record of each video in
    manifest.jsonl.

    Parameters
    ----------
    no_video
        Do not write a video, only other outputs.
    tracks
        Write the boxes of every frame: .txt (MOTChallenge), .csv, .jsonl or .coco.json. With -,
        write .jsonl to standard output. With -d, only the ending of the names. Can be repeated.
    vehicles
        Write a record of each vehicle: .csv, .json or .parquet. With -d, only the ending of the
        names.
    crops
        Write the best image of each vehicle into DIR. With -d, an ending such as .crops.
    page
        Write a report about the vehicles, page.html, into DIR. With -d, an ending such as .page.
    clips
        Write a clip of each time span with vehicles into DIR. With lines or zones, only counted
        vehicles have clips. With -d, an ending such as .clips.
    margin
        Time added to a clip before and after (`clips.margin`).
    exact
        Cut clips at exact frames by encoding them again. By default, whole key-frame intervals are
        copied (`clips.exact`).
    counts
        Write counts at lines and zones: .csv has the events, .totals.csv, .wide.csv and .zones.csv
        have tables by interval, .json has everything. Can be repeated. With -d, only the ending of
        the names.
    flows
        Write flows from one line or zone to another: .csv has a row for each interval, flow and
        class, .wide.csv has a row for each interval, with sums, .matrix.csv has a matrix, .json has
        the flows and the matrix. Can be repeated. With -d, only the ending of the names.
    frames
        Process at most N frames.
    stride
        Search every N-th frame (`detector.stride`).
    threads
        Search one video in N threads.
    stages
        Write an image of every stage of one frame into DIR. Requires --at.
    at
        Time of the frame for --stages.
    strict
        Exit with code 4 if a result is doubtful. Outputs are still written.
    folder
        Process every CLIP, and write the outputs into DIR.
    jobs
        With -d: process N videos at once.
    skip_existing
        With -d: skip videos whose outputs are all up to date.
    dry_run
        With -d: list what would be written, and stop.

    Examples
    --------
    vdet detect-video in.mp4
    vdet detect-video in.mp4 out.mp4 --tracks out.csv
    vdet detect-video in.mp4 --no-video --tracks - --start 1:30 --end 2:00
    vdet detect-video in.mp4 --no-video --stages stages --at 12.5
    vdet detect-video in.mp4 --no-video -c gate.yaml --flows flows.csv --interval 15min
    vdet detect-video clips/ -d found --tracks .jsonl --skip-existing
    """
    outputs = options.wanted_outputs()
    for_batch = jobs or skip_existing or dry_run or scheduler
    is_reversed = start is not None and end is not None and end <= start
    has_stages = any(output.sink == "stages" for output in outputs)
    has_nothing = no_video and not outputs and (folder or len(videos) < 2)
    for is_wrong, words in (
        (for_batch and not folder, "--jobs, --skip-existing, --dry-run and --scheduler require -d"),
        (overwrite and skip_existing, "--overwrite and --skip-existing cannot be used together"),
        (jobs and scheduler, "--jobs and --scheduler cannot be used together"),
        (is_reversed, "--end must be later than --start"),
        ((at is None) == has_stages, "--stages and --at must be used together"),
        (has_nothing, "no output; add one, such as --tracks"),
    ):
        if is_wrong:
            raise click.UsageError(words)
    source = Path()
    if folder is None:
        source, outputs = _in_and_out(videos, outputs, no_video=no_video)
    settings = options.read_settings()
    check_counting(settings, several=folder is not None)
    from vdet.regions import check_masks
    from vdet.run.video import Run

    check_masks(settings.regions)
    if folder is not None:
        outputs = _with_endings(outputs, no_video=no_video)
    part = start, end, frames, at or Fraction(0)
    run = Run(source, tuple(outputs), settings, *part, overwrite, threads)
    if folder is None:
        code, is_doubtful = 0, _process_one(run)
    else:
        from vdet.batch.run import make_plan

        if scheduler:  # the workers were started in other folders
            videos, folder = tuple(clip.absolute() for clip in videos), folder.absolute()
        plan = make_plan(videos, folder, run, skip_existing=skip_existing)
        if dry_run:
            return _print_plan(plan)
        code, is_doubtful = _process_batch(plan, jobs, scheduler)
    return code or (DOUBTFUL if strict and is_doubtful else 0)


def _in_and_out(
    clips: tuple[Path, ...], wanted: list[Output], *, no_video: bool
) -> tuple[Path, list[Output]]:
    """Return the source, and all outputs including the video."""
    source, *videos = clips
    is_beside = not (no_video or wanted or videos or source.is_dir() or "%" in source.name)
    if no_video == bool(videos) and not is_beside:
        raise click.UsageError("pass either OUT or --no-video; for several videos, add -d DIR")
    from vdet.media.writer import may_replace_video
    from vdet.run.sinks.protocol import sink_kind

    if is_beside:
        from vdet.batch.inputs import DRAWN

        suffix = sink_kind("video").suffix_for(source)
        videos = [source.with_name(f"{source.stem}{DRAWN}{suffix}")]
    is_kept = any(path.is_file() and not may_replace_video(path) for path in videos[:1])
    if len(videos) > 1 or is_kept:
        shown = shlex.join(map(str, clips[:2])) + (" …" if len(clips) > 2 else "")
        raise click.UsageError(
            f"{videos[0]} would be replaced, but vdet did not write it; remove it, or for several "
            f"videos use a folder: vdet detect-video {shown} -d found"
        )
    return source, [*(Output("video", path) for path in videos), *wanted]


def _with_endings(outputs: list[Output], *, no_video: bool) -> list[Output]:
    """Return the outputs of a batch, whose paths are endings of names."""
    from vdet.run.sinks.protocol import sink_kind

    endings = []
    for output in outputs:
        sink, kind, suffix = output.sink, sink_kind(output.sink), str(output.path).lower()
        if kind.takes == "images" or kind.one_frame:
            raise click.UsageError(f"{sink}: cannot be written with -d; remove one of them")
        if not _SUFFIX.fullmatch(suffix) or not kind.takes_name(f"video{suffix}"):
            known = ", ".join(kind.endings) or f"as in .{sink if kind.folder_pattern else 'txt'}"
            raise click.UsageError(f"{sink}: with -d, pass only the ending of the names: {known}")
        endings.append(Output(sink, Path(suffix)))
    has_video = no_video or any(output.sink == "video" for output in outputs)
    return endings if has_video else [Output("video", Path()), *endings]


def _process_one(run: "Run") -> bool:
    """Process a video, and return whether the result is doubtful."""
    from vdet.detect.factory import load_detector
    from vdet.run.loop import Parts
    from vdet.run.result import findings_in
    from vdet.run.sinks.protocol import STANDARD_OUTPUT
    from vdet.run.video import run_video

    parts = Parts(load_detector(run.settings.detector))
    with progress_steps(" frames") as steps:
        steps("opening", None)
        totals = run_video(run, parts, progress=partial(steps, ""))
    rate = totals.frames / totals.seconds
    found = f"{counted(totals.frames, 'frame')}, {counted(totals.tracks, 'track')}"
    announce(f"{run.source}: {found}, {totals.seconds:.1f} s, {rate:.1f} frames/s")
    paths = [output.path for output in run.outputs if output.path != STANDARD_OUTPUT]
    announce(*(f"{path}: written" for path in paths))
    if totals.clock and run.settings.traffic:
        announce(f"{run.source}: begins {totals.clock}")
    return findings_in(totals.facts).is_doubtful


def _print_plan(plan: "Plan") -> int:
    for runs, form in ((plan.skipped, "{}: {} up to date"), (plan.runs, "{} → {}")):
        for run in runs:
            print_lines(form.format(run.source, ", ".join(str(item.path) for item in run.outputs)))
    return 0


def _process_batch(plan: "Plan", jobs: int | None, scheduler: str | None) -> tuple[int, bool]:
    """Process a batch; return the exit code, and whether a result is doubtful."""
    from vdet.batch.run import run_batch

    cores = core_count()
    jobs = max(1, min(jobs or cores, len(plan.runs)))
    workers: Workers = LocalProcesses(jobs)
    if scheduler:
        workers, jobs = DaskCluster(scheduler), cores  # a thread for each file
    records = []
    with (
        progress_steps(" files") as steps,
        closing(run_batch(plan, workers=workers, threads=max(1, cores // jobs))) as results,
    ):
        advance = steps("", len(plan.runs))
        for run, record in results:
            _print_result(run, record)
            records.append(record)
            advance(1)
    failed = sum(record.error is not None for record in records)
    skipped = f"{len(plan.skipped)} skipped, " if plan.skipped else ""
    done = counted(len(records) - failed, "file")
    announce(f"{plan.folder}: {done} done, {skipped}{failed} failed")
    code = failure_code(failed, len(plan.runs) + len(plan.skipped))
    return code, any(record.is_doubtful for record in records)


def _print_result(run: "Run", record: "Record") -> None:
    for warning in record.warnings:
        log.warning("%s", warning)
    if record.error:
        log.error("%s", record.error)
    else:
        found = f"{counted(record.frames or 0, 'frame')}, {counted(record.tracks or 0, 'track')}"
        begin = f", begins {record.begin}" if record.begin and run.settings.traffic else ""
        announce(f"{run.source}: {found}, {record.seconds:.1f} s{begin}")
