"""`vdet detect-video -d DIR CLIP...`: many videos in one run."""

import hashlib
import logging
import re
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click

from vdet.batch.digest import work_digest
from vdet.batch.manifest import Origin, Record
from vdet.batch.plan import OutputOptions, OutputSuffix, Plan, make_plan
from vdet.batch.run import run_batch, write_totals
from vdet.batch.task import Work
from vdet.cli.messages import batch_bar, counted, print_lines, print_message
from vdet.cli.options import PATH, PROCESSES, scheduler_option
from vdet.config.schema import Settings
from vdet.detect.factory import model_file
from vdet.errors import failure_code
from vdet.run.sinks.protocol import Output, sink_kind
from vdet.run.video import VideoJob
from vdet.version import __version__
from vdet.workers import DaskCluster, LocalProcesses, Workers, core_count

F = TypeVar("F", bound=Callable[..., Any])

log = logging.getLogger("vdet")

_SUFFIX = re.compile(r"(\.[a-z0-9_-]+)+", re.ASCII)
"""The end of an output's name, such as `.csv` or `.cars.csv`."""


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """The values of `batch_options`; without a `folder` there is no batch."""

    folder: Path | None
    jobs: int | None
    skip_existing: bool
    dry_run: bool
    scheduler: str | None

    @property
    def need_folder(self) -> bool:
        """Whether an option is given that has no effect without a folder."""
        return bool(self.jobs or self.skip_existing or self.dry_run or self.scheduler)


def batch_options(command: F) -> F:
    """Add the options of a batch; they make a `BatchOptions`."""
    for option in (
        scheduler_option,
        click.option(
            "--dry-run", is_flag=True, help="With -d: list what would be written, and end."
        ),
        click.option(
            "--skip-existing",
            is_flag=True,
            help="With -d: leave out videos whose outputs are all there and up to date.",
        ),
        click.option(
            "--jobs",
            type=PROCESSES,
            metavar="N",
            show_default="one for each core",
            help="With -d: process N videos at once, each in its own process.",
        ),
        click.option(
            "-d",
            "--directory",
            "folder",
            type=PATH,
            metavar="DIR",
            help="Process every CLIP, and write the outputs into DIR.",
        ),
    ):
        command = option(command)
    return command


def output_options(
    options: BatchOptions,
    *,
    no_video: bool,
    others: Sequence[Output],
    overwrite: bool,
) -> OutputOptions:
    """Return which outputs the videos of a batch get; raise `click.UsageError` on nonsense."""
    suffixes = [OutputSuffix(output.sink, _suffix(output)) for output in others]
    for each, count in Counter(suffixes).items():
        if count > 1:
            raise click.UsageError(f"{each.sink} is given {each.suffix} twice; leave one out")
    if not no_video and not any(each.sink == "video" for each in suffixes):
        suffixes.insert(0, OutputSuffix("video"))
    if not suffixes:
        raise click.UsageError(
            "nothing would be written; leave out --no-video, or give --tracks or --sink"
        )
    if overwrite and options.skip_existing:
        raise click.UsageError("--overwrite and --skip-existing do not go together")
    if options.jobs and options.scheduler:
        raise click.UsageError("--jobs is for this machine; leave it out, or --scheduler")
    return OutputOptions(suffixes, overwrite=overwrite, skip_existing=options.skip_existing)


def _suffix(output: Output) -> str:
    """Return the suffix of an output in a batch; the rest of its name is that of the video."""
    kind, suffix = sink_kind(output.sink), str(output.path).lower()
    if kind.takes == "pictures":
        raise click.UsageError(f"{output.sink}: is for pictures; give another sink")
    if kind.one_frame:
        raise click.UsageError(f"{output.sink}: is for one video; leave out -d")
    if not _SUFFIX.fullmatch(suffix) or not kind.takes_name(f"video{suffix}"):
        example = f".{output.sink}" if kind.marker else ".txt"
        known = ", ".join(kind.suffixes) or f"as in {example}"
        flags = {flag for each in click.get_current_context().command.params for flag in each.opts}
        option = f"--{output.sink}"
        option = option if option in flags else f"--sink {output.sink}"
        raise click.UsageError(f"with -d give {option} a suffix: {known}")
    return suffix


def process_batch(
    clips: Sequence[Path],
    common: VideoJob,
    outputs: OutputOptions,
    options: BatchOptions,
    *,
    settings: Settings,
    model: Path | None,
    threads: int | None,
    quiet: bool,
) -> int:
    """Process a batch, or list what would be written, and return the exit code."""
    folder = options.folder or Path()
    if options.scheduler:  # the workers were started in other folders
        clips, folder = [clip.absolute() for clip in clips], folder.absolute()
        model = model.absolute() if model else None
        settings = _with_absolute_mask(settings)
    origin = _origin(settings, model)
    digest = work_digest(origin, settings, common)
    plan = make_plan(clips, folder, common, outputs, digest)
    if options.dry_run:
        print_lines(*_plan_lines(plan))
        return 0
    if not plan.jobs:
        write_totals(plan)  # a run that was interrupted may have left them out
        print_message(f"{plan.folder}: {counted(len(plan.skipped), 'file')} there already")
        return 0
    workers, search_threads = _workers(options, len(plan.jobs))
    work = Work(settings, model, threads or search_threads, digest)
    failed = _run(plan, work, origin, workers, quiet=quiet)
    return failure_code(len(failed), len(plan.jobs) + len(plan.skipped))


def _with_absolute_mask(settings: Settings) -> Settings:
    regions = settings.regions
    if not regions.mask:
        return settings
    regions = regions.model_copy(update={"mask": str(Path(regions.mask).absolute())})
    return settings.model_copy(update={"regions": regions})


def _plan_lines(plan: Plan) -> list[str]:
    """Return a line for each file: what would be written."""
    return [
        *(f"{job.source}: {_output_names(job)} there already" for job in plan.skipped),
        *(f"{job.source} → {_output_names(job)}" for job in plan.jobs),
    ]


def _output_names(job: VideoJob) -> str:
    return ", ".join(str(output.path) for output in job.outputs)


def _run(plan: Plan, work: Work, origin: Origin, workers: Workers, *, quiet: bool) -> list[Record]:
    """Run the batch, print the result of each file, and return the records of those that failed."""
    failed = []
    sources = [job.source for job in plan.jobs]
    with (
        batch_bar(sources, by_size=not _is_limited(plan), quiet=quiet) as counts,
        closing(run_batch(plan, work, origin, workers=workers, counts=counts)) as results,
    ):
        for job, record in results:
            _print_result(job, record, quiet=quiet)
            if record.error:
                failed.append(record)
    if not quiet:
        skipped = f"{len(plan.skipped)} there already, " if plan.skipped else ""
        done = len(plan.jobs) - len(failed)
        print_message(
            f"{plan.manifest}: {counted(done, 'file')} done, {skipped}{len(failed)} failed"
        )
    return failed


def _is_limited(plan: Plan) -> bool:
    """Return whether about as many frames are read of a long video as of a short one."""
    return any(job.frames is not None or job.end is not None for job in plan.jobs)


def _origin(settings: Settings, model: Path | None) -> Origin:
    program = f"vdet {__version__}"
    path = model_file(settings.detector, model)
    if path is None:
        return Origin(program, None, None)
    return Origin(program, path.name, hashlib.sha256(path.read_bytes()).hexdigest())


def _workers(options: BatchOptions, files: int) -> tuple[Workers, int]:
    """Return the workers of a batch, and how many threads search each file there."""
    if options.scheduler:
        return DaskCluster(options.scheduler), 1
    cores = core_count()
    jobs = min(options.jobs or cores, files)
    return LocalProcesses(jobs), max(1, cores // jobs)


def _print_result(job: VideoJob, record: Record, *, quiet: bool) -> None:
    for warning in record.warnings:
        log.warning("%s", warning)
    if record.error:
        log.error("%s", record.error)
    elif not quiet:
        found = f"{counted(record.frames, 'frame')}, {counted(record.tracks, 'track')}"
        print_message(f"{job.source}: {found}, {record.seconds:.1f} s")
