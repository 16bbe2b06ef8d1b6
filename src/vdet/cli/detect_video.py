"""`vdet detect-video`: find and follow vehicles in one video, or in many."""

import logging
import re
import shlex
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
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

if TYPE_CHECKING:
    from vdet.batch.manifest import Record
    from vdet.batch.run import Plan
    from vdet.run.video import Run
    from vdet.workers import Workers

log = logging.getLogger("vdet")

_SUFFIX = re.compile(r"(\.[a-z0-9_-]+)+", re.ASCII)
"""The ending of an output's name, such as `.csv` or `.cars.csv`."""


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """The values of `_batch_options`; without a `folder` there is no batch."""

    folder: Path | None
    jobs: int | None
    skip_existing: bool
    dry_run: bool
    scheduler: str | None

    def check(self, *, overwrite: bool) -> None:
        """Raise `click.UsageError` where options do not go together."""
        others = self.jobs or self.skip_existing or self.dry_run or self.scheduler
        if self.folder is None and others:
            raise click.UsageError("--jobs, --skip-existing, --dry-run and --scheduler require -d")
        if overwrite and self.skip_existing:
            raise click.UsageError("--overwrite and --skip-existing cannot be used together")
        if self.jobs and self.scheduler:
            raise click.UsageError("--jobs and --scheduler cannot be used together")


_batch_options = options.bundle(
    "batch",
    BatchOptions,
    options.option("-d, --directory DIR", name="folder"),
    options.jobs_option,
    options.option("--skip-existing"),
    options.option("--dry-run"),
    options.scheduler_option,
)


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
@_batch_options
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
    choice: options.SettingsChoice,
    overwrite: bool,
    strict: bool,
    batch: BatchOptions,
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
        Write the boxes of every frame: .txt (MOTChallenge), .csv, .jsonl, .coco.json, .xml (CVAT),
        .kitti.txt, .yolo.zip or .ottrk. With -, write .jsonl to standard output. With -d, only the
        ending of the names. Can be repeated.
    vehicles
        Write a record of each vehicle: .csv, .json or .parquet. With -d, only the ending of the
        names.
    crops
        Write the best image of each vehicle into DIR. With -d, an ending such as .crops.
    page
        Write a report about the vehicles, page.html, into DIR. With -d, an ending such as .page.
    clips
        Write a clip of each time in which vehicles are shown (with lines or zones: counted) into
        DIR. With -d, an ending such as .clips.
    margin
        Time added to a clip before and after (`clips.margin`).
    exact
        Cut clips at exact frames, which encodes them. By default, whole key-frame intervals are
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
    wanted = options.wanted_outputs()
    batch.check(overwrite=overwrite)
    if start is not None and end is not None and end <= start:
        raise click.UsageError("--end must be later than --start")
    if (at is None) == any(sink == "stages" for sink, _ in wanted):
        raise click.UsageError("--stages and --at must be used together")
    source = Path()
    if batch.folder is None:
        source, video = _in_and_out(videos, no_video=no_video, is_alone=not (wanted or no_video))
        wanted = [*video, *wanted]
    if no_video and not wanted:
        raise click.UsageError("no output; add one, such as --tracks")
    settings = choice.read()
    check_counting(settings, several=batch.folder is not None)
    from vdet.regions import check_masks
    from vdet.run.video import Run

    check_masks(settings.regions)
    if batch.folder is not None:
        wanted = [(sink, Path(_ending(sink, path))) for sink, path in wanted]
        if not no_video and not any(sink == "video" for sink, _ in wanted):
            wanted.insert(0, ("video", Path()))
    part = start, end, frames, at or Fraction(0)
    run = Run(source, options.as_outputs(wanted), settings, *part, overwrite, threads)
    if batch.folder is not None:
        return _process_batch(videos, run, batch, strict=strict)
    is_doubtful = _process_one(run)
    return DOUBTFUL if strict and is_doubtful else 0


def _in_and_out(
    clips: tuple[Path, ...], *, no_video: bool, is_alone: bool
) -> tuple[Path, list[options.Wanted]]:
    """Return the source, and the video to write; `is_alone`: no other output is asked for."""
    source, *outputs = clips
    is_beside = is_alone and not (outputs or source.is_dir() or "%" in source.name)
    if no_video == bool(outputs) and not is_beside:
        raise click.UsageError("pass one OUT, or --no-video; or -d DIR for several videos")
    from vdet.media.writer import may_replace_video
    from vdet.run.sinks.protocol import sink_kind

    if is_beside:
        from vdet.batch.inputs import DRAWN

        suffix = sink_kind("video").suffix_for(source)
        outputs = [source.with_name(f"{source.stem}{DRAWN}{suffix}")]
    is_kept = any(path.is_file() and not may_replace_video(path) for path in outputs[:1])
    if len(outputs) > 1 or is_kept:
        shown = shlex.join(map(str, clips[:2])) + (" …" if len(clips) > 2 else "")
        raise click.UsageError(
            f"{outputs[0]} would be replaced, but vdet did not write it; remove it, or for several "
            f"videos use a folder: vdet detect-video {shown} -d found"
        )
    return source, [("video", path) for path in outputs]


def _process_one(run: "Run") -> bool:
    """Process a video, and return whether the result is doubtful."""
    from vdet.detect.factory import load_detector
    from vdet.run.result import findings_in
    from vdet.run.video import run_video

    model = load_detector(run.settings.detector)
    with progress_steps(" frames") as steps:
        steps("opening", None)
        totals = run_video(run, model, progress=partial(steps, ""))
    rate = totals.frames / totals.seconds
    found = f"{counted(totals.frames, 'frame')}, {counted(totals.tracks, 'track')}"
    announce(f"{run.source}: {found}, {totals.seconds:.1f} s, {rate:.1f} frames/s")
    announce(*(f"{output.path}: written" for output in run.outputs if output.sink == "video"))
    if totals.clock and run.settings.traffic:
        announce(f"{run.source}: begins {totals.clock}")
    return findings_in(totals.facts).is_doubtful


def _ending(sink: str, path: Path) -> str:
    """Return the ending of an output's name; the rest of it is the name of the video."""
    from vdet.run.sinks.protocol import sink_kind

    kind, suffix = sink_kind(sink), str(path).lower()
    if kind.takes == "pictures" or kind.one_frame:
        raise click.UsageError(f"{sink}: cannot be written with -d; remove one of them")
    if not _SUFFIX.fullmatch(suffix) or not kind.takes_name(f"video{suffix}"):
        known = ", ".join(kind.endings) or f"as in .{sink if kind.marker else 'txt'}"
        raise click.UsageError(f"{sink}: with -d, pass only the ending of the names: {known}")
    return suffix


def _process_batch(
    clips: Sequence[Path], common: "Run", batch: BatchOptions, *, strict: bool
) -> int:
    """Process a batch, or list what would be written, and return the exit code."""
    from vdet.batch.run import make_plan

    folder = batch.folder or Path()
    if batch.scheduler:  # the workers were started in other folders
        clips, folder = [clip.absolute() for clip in clips], folder.absolute()
    plan = make_plan(clips, folder, common, skip_existing=batch.skip_existing)
    if batch.dry_run:
        print_lines(
            *(f"{run.source}: {_output_names(run)} up to date" for run in plan.skipped),
            *(f"{run.source} → {_output_names(run)}" for run in plan.runs),
        )
        return 0
    records = _run(plan, batch)
    failed = sum(record.error is not None for record in records)
    skipped = f"{len(plan.skipped)} skipped, " if plan.skipped else ""
    announce(f"{folder}: {counted(len(records) - failed, 'file')} done, {skipped}{failed} failed")
    code = failure_code(failed, len(plan.runs) + len(plan.skipped))
    is_doubtful = any(record.is_doubtful for record in records)
    return code or (DOUBTFUL if strict and is_doubtful else 0)


def _output_names(run: "Run") -> str:
    return ", ".join(str(output.path) for output in run.outputs)


def _run(plan: "Plan", batch: BatchOptions) -> "list[Record]":
    """Run the batch, print the result of each video, and return their records."""
    from vdet.batch.run import run_batch
    from vdet.workers import DaskCluster, LocalProcesses, core_count

    cores = core_count()
    jobs = max(1, min(batch.jobs or cores, len(plan.runs)))
    workers: Workers = LocalProcesses(jobs)
    if batch.scheduler:
        workers, jobs = DaskCluster(batch.scheduler), cores  # a thread for each file
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
    return records


def _print_result(run: "Run", record: "Record") -> None:
    for warning in record.warnings:
        log.warning("%s", warning)
    if record.error:
        log.error("%s", record.error)
    else:
        found = f"{counted(record.frames or 0, 'frame')}, {counted(record.tracks or 0, 'track')}"
        begin = f", begins {record.begin}" if record.begin and run.settings.traffic else ""
        announce(f"{run.source}: {found}, {record.seconds:.1f} s{begin}")
