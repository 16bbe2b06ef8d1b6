"""`vdet detect-video`: find and follow vehicles in one video, or in many."""

import logging
import re
import shlex
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
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
    from vdet.batch.run import OutputSuffix, Plan
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
    options.option(
        "-d, --directory DIR", "Process every CLIP, and write the outputs into DIR.", name="folder"
    ),
    options.jobs_option("With -d: process N videos at once."),
    options.option("--skip-existing", "With -d: skip videos whose outputs are all up to date."),
    options.option("--dry-run", "With -d: list what would be written, and stop."),
    options.scheduler_option,
)


@command(
    "vdet detect-video in.mp4",
    "vdet detect-video in.mp4 out.mp4 --tracks out.csv",
    "vdet detect-video in.mp4 --no-video --tracks - --start 1:30 --end 2:00",
    "vdet detect-video in.mp4 --no-video --stages stages --at 12.5",
    "vdet detect-video in.mp4 --no-video -c gate.yaml --flows flows.csv --interval 15min",
    "vdet detect-video clips/ -d found --tracks .jsonl --skip-existing",
)
@click.argument("videos", nargs=-1, required=True, type=options.PATH, metavar="IN [OUT] | CLIP...")
@options.option("--no-video", "Do not write a video, only other outputs.")
@options.output_option(
    "--tracks FILE",
    "Write the boxes of every frame: .txt (MOTChallenge), .csv, .jsonl, .coco.json, .xml "
    "(CVAT), .kitti.txt, .yolo.zip or .ottrk. With -, write .jsonl to standard output. With -d, "
    "only the ending of the names. Can be repeated.",
)
@options.output_option(
    "--vehicles FILE",
    "Write a record of each vehicle: .csv, .json or .parquet. With -d, only the ending of the "
    "names.",
)
@options.output_option(
    "--crops DIR",
    "Write the best image of each vehicle into DIR. With -d, an ending such as .crops.",
)
@options.output_option(
    "--page DIR",
    "Write a report about the vehicles, page.html, into DIR. With -d, an ending such as .page.",
)
@options.output_option(
    "--clips DIR",
    "Write a clip of each time in which vehicles are shown (with lines or zones: counted) into "
    "DIR. With -d, an ending such as .clips.",
)
@options.short_form(
    "--margin SECONDS", "clips.margin", "Time added to a clip before and after.", float
)
@options.short_form(
    "--exact",
    "clips.exact",
    "Cut clips at exact frames, which encodes them. By default, whole key-frame intervals are "
    "copied.",
)
@counting_options(" With -d, only the ending of the names.")
@options.sink_option
@options.start_option
@options.end_option
@options.option("--frames N", "Process at most N frames.", options.POSITIVE)
@options.short_form(
    "--stride N", "detector.stride", "Search every N-th frame.", click.IntRange(1, 100)
)
@options.option(
    "--threads N",
    "Search one video in N threads.",
    options.PROCESSES,
    show_default="one per core, shared by --jobs",
)
@options.output_option(
    "--stages DIR", "Write an image of every stage of one frame into DIR. Requires --at."
)
@options.class_option
@options.option(f"--at {options.TIME_FORM}", "Time of the frame for --stages.", options.parse_time)
@options.option("--strict", "Exit with code 4 if a result is doubtful. Outputs are still written.")
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
    """
    wanted = options.wanted_outputs()
    batch.check(overwrite=overwrite)
    if start is not None and end is not None and end <= start:
        raise click.UsageError("--end must be later than --start")
    if (at is None) == any(sink == "stages" for sink, _ in wanted):
        raise click.UsageError("--stages and --at must be used together")
    source = Path()
    if batch.folder is None:
        source, video = _in_and_out(videos, no_video=no_video, is_alone=not wanted)
        wanted = [*video, *wanted]
    if no_video and not wanted:
        raise click.UsageError("no output; add one, such as --tracks")
    settings = choice.read()
    check_counting(settings, several=batch.folder is not None)
    from vdet.regions import check_masks
    from vdet.run.video import Run

    check_masks(settings.regions)
    part = start, end, frames, at or Fraction(0)
    run = Run(source, (), settings, *part, overwrite, threads)
    if batch.folder is None:
        is_doubtful = _process_one(replace(run, outputs=options.as_outputs(wanted)))
        return DOUBTFUL if strict and is_doubtful else 0
    suffixes = _read_suffixes(wanted, no_video=no_video)
    return _process_batch(videos, run, suffixes, batch, strict=strict)


def _in_and_out(
    clips: tuple[Path, ...], *, no_video: bool, is_alone: bool
) -> tuple[Path, list[options.Wanted]]:
    """Return the source, and the video to write; `is_alone`: there are no other outputs."""
    source, *outputs = clips
    if is_alone and not (outputs or no_video or source.is_dir() or "%" in source.name):
        outputs = [_beside(source)]
    is_kept = False
    if outputs and outputs[0].is_file():
        from vdet.media.writer import may_replace_video

        is_kept = not may_replace_video(outputs[0])
    if len(outputs) > 1 or is_kept:
        shown = shlex.join(map(str, clips[:2])) + (" …" if len(clips) > 2 else "")
        raise click.UsageError(
            f"{outputs[0]} would be replaced, but vdet did not write it; remove it, or for several "
            f"videos use a folder: vdet detect-video {shown} -d found"
        )
    if no_video == bool(outputs):
        raise click.UsageError("pass one OUT, or --no-video; or -d DIR for several videos")
    return source, [("video", path) for path in outputs]


def _beside(source: Path) -> Path:
    from vdet.batch.inputs import DRAWN
    from vdet.run.sinks.protocol import sink_kind

    return source.with_name(f"{source.stem}{DRAWN}{sink_kind('video').suffix_for(source)}")


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


def _read_suffixes(wanted: Sequence[options.Wanted], *, no_video: bool) -> "list[OutputSuffix]":
    """Return which outputs the videos of a batch get; raise `click.UsageError` on nonsense."""
    from vdet.batch.run import OutputSuffix

    suffixes = [OutputSuffix(sink, _suffix(sink, path)) for sink, path in wanted]
    if not no_video and not any(suffix.sink == "video" for suffix in suffixes):
        suffixes.insert(0, OutputSuffix("video"))
    return suffixes


def _suffix(sink: str, path: Path) -> str:
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
    clips: Sequence[Path],
    common: "Run",
    suffixes: "Sequence[OutputSuffix]",
    batch: BatchOptions,
    *,
    strict: bool,
) -> int:
    """Process a batch, or list what would be written, and return the exit code."""
    from vdet.batch.run import make_plan

    folder = batch.folder or Path()
    if batch.scheduler:  # the workers were started in other folders
        clips, folder = [clip.absolute() for clip in clips], folder.absolute()
    plan = make_plan(clips, folder, common, suffixes, skip_existing=batch.skip_existing)
    if batch.dry_run:
        print_lines(
            *(f"{run.source}: {_output_names(run)} up to date" for run in plan.skipped),
            *(f"{run.source} → {_output_names(run)}" for run in plan.runs),
        )
        return 0
    workers, threads = _workers(batch, len(plan.runs))
    failed, doubtful = _run(plan, workers, threads)
    code = failure_code(failed, len(plan.runs) + len(plan.skipped))
    return code or (DOUBTFUL if strict and doubtful else 0)


def _output_names(run: "Run") -> str:
    return ", ".join(str(output.path) for output in run.outputs)


def _workers(batch: BatchOptions, files: int) -> "tuple[Workers, int]":
    """Return the workers of a batch, and how many threads search each file there."""
    from vdet.workers import DaskCluster, LocalProcesses, core_count

    if batch.scheduler:
        return DaskCluster(batch.scheduler), 1
    cores = core_count()
    jobs = max(1, min(batch.jobs or cores, files))
    return LocalProcesses(jobs), max(1, cores // jobs)


def _run(plan: "Plan", workers: "Workers", threads: int) -> tuple[int, int]:
    """Run the batch, print the results; return how many files failed, and how many are doubtful."""
    from vdet.batch.run import run_batch
    from vdet.run.result import CONDITIONS

    failed = doubtful = 0
    with (
        progress_steps(" files") as steps,
        closing(run_batch(plan, workers=workers, threads=threads)) as results,
    ):
        advance = steps("", len(plan.runs))
        for run, record in results:
            _print_result(run, record)
            failed += record.error is not None
            found = record.facts.get(CONDITIONS, ())
            doubtful += any(finding["severity"] == "warning" for finding in found)
            advance(1)
    skipped = f"{len(plan.skipped)} skipped, " if plan.skipped else ""
    done = counted(len(plan.runs) - failed, "file")
    announce(f"{plan.folder}: {done} done, {skipped}{failed} failed")
    return failed, doubtful


def _print_result(run: "Run", record: "Record") -> None:
    for warning in record.warnings:
        log.warning("%s", warning)
    if record.error:
        log.error("%s", record.error)
    else:
        found = f"{counted(record.frames or 0, 'frame')}, {counted(record.tracks or 0, 'track')}"
        begin = f", begins {record.begin}" if record.begin and run.settings.traffic else ""
        announce(f"{run.source}: {found}, {record.seconds:.1f} s{begin}")
