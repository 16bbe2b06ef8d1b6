"""`vdet detect-video -d DIR CLIP...`: many videos in one run."""

import logging
import re
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli.messages import counted, is_quiet, print_lines, print_message, progress_steps
from vdet.cli.options import Wanted, bundle, jobs_option, option, scheduler_option
from vdet.errors import failure_code

if TYPE_CHECKING:
    from vdet.batch.manifest import Record
    from vdet.batch.plan import OutputSuffix, Plan
    from vdet.batch.task import Work
    from vdet.run.video import VideoJob
    from vdet.workers import Workers

log = logging.getLogger("vdet")

_SUFFIX = re.compile(r"(\.[a-z0-9_-]+)+", re.ASCII)
"""The ending of an output's name, such as `.csv` or `.cars.csv`."""


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """The values of `batch_options`; without a `folder` there is no batch."""

    folder: Path | None
    jobs: int | None
    skip_existing: bool
    dry_run: bool
    scheduler: str | None

    def check(self, *, overwrite: bool) -> None:
        """Raise `click.UsageError` where options do not go together."""
        others = self.jobs or self.skip_existing or self.dry_run or self.scheduler
        if self.folder is None and others:
            raise click.UsageError(
                "--jobs, --skip-existing, --dry-run and --scheduler go with -d DIR"
            )
        if overwrite and self.skip_existing:
            raise click.UsageError("--overwrite and --skip-existing do not go together")
        if self.jobs and self.scheduler:
            raise click.UsageError("--jobs is for this machine; leave it out, or --scheduler")


batch_options = bundle(
    "batch",
    BatchOptions,
    option(
        "-d, --directory DIR", "Process every CLIP, and write the outputs into DIR.", name="folder"
    ),
    jobs_option("With -d: process N videos at once, each in its own process."),
    option("--skip-existing", "With -d: skip videos whose outputs are all there and up to date."),
    option("--dry-run", "With -d: list what would be written, and stop."),
    scheduler_option,
)


def read_suffixes(wanted: Sequence[Wanted], *, no_video: bool) -> "list[OutputSuffix]":
    """Return which outputs the videos of a batch get; raise `click.UsageError` on nonsense."""
    from vdet.batch.plan import OutputSuffix

    suffixes = [OutputSuffix(sink, _suffix(sink, path)) for sink, path in wanted]
    if not no_video and not any(each.sink == "video" for each in suffixes):
        suffixes.insert(0, OutputSuffix("video"))
    return suffixes


def _suffix(sink: str, path: Path) -> str:
    """Return the ending of an output's name; the rest of it is the name of the video."""
    from vdet.run.sinks.protocol import sink_kind

    kind, suffix = sink_kind(sink), str(path).lower()
    if kind.takes == "pictures" or kind.one_frame:
        raise click.UsageError(f"{sink}: cannot be written with -d; leave one of them out")
    if not _SUFFIX.fullmatch(suffix) or not kind.takes_name(f"video{suffix}"):
        known = ", ".join(kind.endings) or f"as in .{sink if kind.marker else 'txt'}"
        raise click.UsageError(f"{sink}: with -d give only the ending of the names: {known}")
    return suffix


def process_batch(
    clips: Sequence[Path],
    common: "VideoJob",
    suffixes: "Sequence[OutputSuffix]",
    work: "Work",
    options: BatchOptions,
) -> int:
    """Process a batch, or list what would be written, and return the exit code."""
    from vdet.batch.plan import make_plan
    from vdet.batch.run import write_totals

    folder = options.folder or Path()
    if options.scheduler:  # the workers were started in other folders
        clips, folder = [clip.absolute() for clip in clips], folder.absolute()
    digest = work.digest if options.skip_existing else None
    plan = make_plan(clips, folder, common, suffixes, digest=digest)
    if options.dry_run:
        print_lines(
            *(f"{job.source}: {_output_names(job)} there already" for job in plan.skipped),
            *(f"{job.source} → {_output_names(job)}" for job in plan.jobs),
        )
        return 0
    if not plan.jobs:
        write_totals(plan)  # a run that was interrupted may have left them out
        print_message(f"{plan.folder}: {counted(len(plan.skipped), 'file')} there already")
        return 0
    workers, threads = _workers(options, len(plan.jobs))
    failed = _run(plan, replace(work, threads=work.threads or threads), workers)
    return failure_code(failed, len(plan.jobs) + len(plan.skipped))


def _output_names(job: "VideoJob") -> str:
    return ", ".join(str(output.path) for output in job.outputs)


def _workers(options: BatchOptions, files: int) -> "tuple[Workers, int]":
    """Return the workers of a batch, and how many threads search each file there."""
    from vdet.workers import DaskCluster, LocalProcesses, core_count

    if options.scheduler:
        return DaskCluster(options.scheduler), 1
    cores = core_count()
    jobs = min(options.jobs or cores, files)
    return LocalProcesses(jobs), max(1, cores // jobs)


def _run(plan: "Plan", work: "Work", workers: "Workers") -> int:
    """Run the batch, print the result of each file, and return how many failed."""
    from vdet.batch.run import run_batch

    failed = 0
    with (
        progress_steps(" files") as steps,
        closing(run_batch(plan, work, workers=workers)) as results,
    ):
        advance = steps("", len(plan.jobs))
        for job, record in results:
            _print_result(job, record)
            failed += record.error is not None
            advance(1)
    if not is_quiet():
        skipped = f"{len(plan.skipped)} there already, " if plan.skipped else ""
        done = counted(len(plan.jobs) - failed, "file")
        print_message(f"{plan.manifest}: {done} done, {skipped}{failed} failed")
    return failed


def _print_result(job: "VideoJob", record: "Record") -> None:
    for warning in record.warnings:
        log.warning("%s", warning)
    if record.error:
        log.error("%s", record.error)
    elif not is_quiet():
        found = f"{counted(record.frames, 'frame')}, {counted(record.tracks, 'track')}"
        print_message(f"{job.source}: {found}, {record.seconds:.1f} s")
