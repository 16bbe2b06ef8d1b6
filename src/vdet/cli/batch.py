"""`vdet detect-video -d DIR`: find and follow vehicles in many videos."""

import re
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli.messages import LOG, announce, progress_steps
from vdet.errors import counted, failure_code
from vdet.run.sinks import Output
from vdet.workers import DaskCluster, LocalProcesses, Workers, core_count

if TYPE_CHECKING:
    from vdet.batch.manifest import Record
    from vdet.batch.run import Plan
    from vdet.run.video import Run

_ENDING = re.compile(r"(\.[a-z0-9_-]+)+", re.ASCII)
"""The ending of an output's name, such as `.csv` or `.cars.csv`."""


def process_videos(
    clips: Sequence[Path],
    folder: Path,
    common: "Run",
    *,
    no_video: bool,
    skip_existing: bool,
    jobs: int | None,
    scheduler: str | None,
) -> tuple[int, bool]:
    """Process the videos of `clips`; arguments as in `make_plan` and in `detect_video`.

    Returns
    -------
    The exit code, and whether a result is doubtful.
    """
    from vdet.batch.run import make_plan

    if no_video and not common.outputs:
        raise click.UsageError("no output; add one, such as --tracks")
    if common.overwrite and skip_existing:
        raise click.UsageError("--overwrite and --skip-existing cannot be used together")
    if jobs and scheduler:
        raise click.UsageError("--jobs and --scheduler cannot be used together")
    if scheduler:  # the workers were started in other folders
        clips, folder = [clip.absolute() for clip in clips], folder.absolute()
    outputs = [_checked_ending(output) for output in common.outputs]
    if not (no_video or any(output.sink == "video" for output in outputs)):
        outputs = [Output("video", Path()), *outputs]
    common = replace(common, outputs=tuple(outputs))
    plan = make_plan(clips, folder, common, skip_existing=skip_existing)
    records = _run_plan(plan, jobs, scheduler)
    failed = sum(record.error is not None for record in records)
    skipped = f"{len(plan.skipped)} skipped, " if plan.skipped else ""
    announce(
        f"{plan.folder}: {counted(len(records) - failed, 'file')} done, {skipped}{failed} failed"
    )
    code = failure_code(failed, len(plan.runs) + len(plan.skipped))
    return code, any(record.is_doubtful for record in records)


def _checked_ending(output: Output) -> Output:
    """Return an output whose path is the ending of names. Raises `click.UsageError`."""
    from vdet.run.sinks.protocol import sink_kind

    sink, kind, ending = output.sink, sink_kind(output.sink), str(output.path).lower()
    if kind.takes == "images" or kind.one_frame:
        raise click.UsageError(f"{sink}: cannot be written with -d; remove one of them")
    if not _ENDING.fullmatch(ending) or not kind.takes_name(f"video{ending}"):
        allowed = ", ".join(kind.endings) or f"as in .{sink if kind.folder_pattern else 'txt'}"
        raise click.UsageError(f"{sink}: with -d, pass only the ending of the names: {allowed}")
    return Output(sink, Path(ending))


def _run_plan(plan: "Plan", jobs: int | None, scheduler: str | None) -> "list[Record]":
    """Process the videos of a plan, print the result of each, and return their records."""
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
    return records


def _print_result(run: "Run", record: "Record") -> None:
    for warning in record.warnings:
        LOG.warning("%s", warning)
    if record.error:
        LOG.error("%s", record.error)
        return
    numbers = f"{counted(record.frames or 0, 'frame')}, {counted(record.tracks or 0, 'track')}"
    begin = f", begins {record.begin}" if record.begin and run.settings.traffic else ""
    announce(f"{run.source}: {numbers}, {record.seconds:.1f} s{begin}")
