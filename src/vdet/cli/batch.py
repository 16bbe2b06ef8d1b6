"""`vdet detect-video CLIP... -d DIR`: many videos in one go."""

import hashlib
import logging
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click

import vdet
from vdet.batch.manifest import Origin, Record
from vdet.batch.plan import Plan, Wishes, make_plan
from vdet.batch.pools import Cluster, Pool, Processes
from vdet.batch.run import run_batch
from vdet.cli.options import PathOf, scheduler_option
from vdet.cli.progress import files_bar, tell
from vdet.config.schema import Settings
from vdet.detect.svm.model import LinearModel
from vdet.errors import SOME_FAILED, VdetError
from vdet.pipeline.run import VideoJob
from vdet.pipeline.sinks.tracks import TRACK_SUFFIXES

F = TypeVar("F", bound=Callable[..., Any])

log = logging.getLogger("vdet")


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """What `batch_options` gave; without a `folder` it is no batch."""

    folder: Path | None
    jobs: int | None
    skip_existing: bool
    dry_run: bool
    scheduler: str | None

    @property
    def any_but_folder(self) -> bool:
        """Whether one was given that says nothing without a folder."""
        return bool(self.jobs or self.skip_existing or self.dry_run or self.scheduler)


@dataclass(frozen=True, slots=True)
class Work:
    """What every file of a batch is processed with."""

    model: LinearModel
    model_path: Path
    settings: Settings
    threads: int | None


def batch_options(command: F) -> F:
    """Add the options of a batch; they make a `BatchOptions`."""
    for option in (
        scheduler_option,
        click.option("--dry-run", is_flag=True, help="With -d: list what would be done."),
        click.option("--skip-existing", is_flag=True, help="With -d: leave out what is done."),
        click.option(
            "--jobs",
            type=click.IntRange(min=1),
            help="With -d: videos at once, each in a process; else one a core.",
        ),
        click.option(
            "-d",
            "--directory",
            "folder",
            type=PathOf(),
            metavar="DIR",
            help="Process every CLIP (files, folders, quoted patterns) into this folder.",
        ),
    ):
        command = option(command)
    return command


def wishes_of(
    options: BatchOptions, *, no_video: bool, tracks: Path | None, overwrite: bool
) -> Wishes:
    """Read what the files of a batch are to become; raise `click.UsageError` on nonsense."""
    suffix = None if tracks is None else str(tracks).lower()
    if suffix not in (None, *TRACK_SUFFIXES):
        raise click.UsageError(f"with -d give --tracks a suffix: {', '.join(TRACK_SUFFIXES)}")
    if no_video and suffix is None:
        raise click.UsageError("nothing would be written; leave out --no-video, or give --tracks")
    if overwrite and options.skip_existing:
        raise click.UsageError("--overwrite and --skip-existing do not go together")
    if options.jobs and options.scheduler:
        raise click.UsageError("--jobs is for this machine; leave it out, or --scheduler")
    return Wishes(not no_video, suffix, overwrite=overwrite, skip_existing=options.skip_existing)


def do_batch(
    clips: Sequence[Path],
    common: VideoJob,
    wishes: Wishes,
    options: BatchOptions,
    work: Work,
    *,
    quiet: bool,
) -> int:
    """Do a batch, or list it, and return the exit code."""
    folder = options.folder or Path()
    if options.scheduler:  # the workers stand in other folders
        clips, folder = [clip.absolute() for clip in clips], folder.absolute()
    plan = make_plan(clips, folder, common, wishes)
    if options.dry_run:
        click.echo("\n".join(_listing(plan)))
        return 0
    if not plan.jobs:
        click.echo(f"all of {len(plan.skipped)} files are there already", err=True)
        return 0
    failed = _run(plan, options, work, quiet=quiet)
    if not failed:
        return 0
    return SOME_FAILED if plan.skipped or len(failed) < len(plan.jobs) else VdetError.exit_code


def _listing(plan: Plan) -> list[str]:
    """Say a line a file what would be done."""
    return [
        *(
            f"{job.source}: {', '.join(map(str, job.outputs))} there already"
            for job in plan.skipped
        ),
        *(f"{job.source} → {', '.join(map(str, job.outputs))}" for job in plan.jobs),
    ]


def _run(plan: Plan, options: BatchOptions, work: Work, *, quiet: bool) -> list[Record]:
    """Run the batch, tell of it on standard error, and return what failed."""
    digest = hashlib.sha256(work.model_path.read_bytes()).hexdigest()
    origin = Origin(f"vdet {vdet.__version__}", work.model_path.name, digest)
    pool, threads = _pool(options, len(plan.jobs))
    results = run_batch(
        plan, work.model, work.settings, origin, pool=pool, threads=work.threads or threads
    )
    failed = []
    with files_bar(len(plan.jobs), quiet=quiet) as advance, closing(results):
        for job, record in results:
            _tell(job, record, quiet=quiet)
            advance(record.frames or 0)
            if record.error:
                failed.append(record)
    if not quiet:
        there = f"{len(plan.skipped)} there already, " if plan.skipped else ""
        done = len(plan.jobs) - len(failed)
        tell(f"{plan.manifest}: {done} files done, {there}{len(failed)} failed")
    for record in failed:
        tell(f"failed: {record.error}")
    return failed


def _pool(options: BatchOptions, files: int) -> tuple[Pool, int]:
    """Return where to work, and how many threads the search of each file has there."""
    if options.scheduler:
        return Cluster(options.scheduler), 1
    from joblib import cpu_count

    cores = cpu_count()
    jobs = min(options.jobs or cores, files)
    return Processes(jobs), max(1, cores // jobs)


def _tell(job: VideoJob, record: Record, *, quiet: bool) -> None:
    for warning in record.warnings:
        log.warning("%s", warning)
    if record.error:
        log.error("%s", record.error)
    elif not quiet:
        found = f"{record.frames} frames, {record.tracks} vehicles"
        tell(f"{job.source}: {found}, {record.seconds:.1f} s")
