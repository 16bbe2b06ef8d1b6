"""Run a planned batch: process every file, and write its record when it has ended."""

import os
from collections.abc import Callable, Generator, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from vdet.batch.manifest import Record, open_manifest, read_written
from vdet.batch.plan import Plan
from vdet.batch.task import Identity, process_file, record_of_killed
from vdet.files import OutputFiles, make_folder, output_errors, remove_stale
from vdet.run.sinks.protocol import VideoPart
from vdet.run.video import Run
from vdet.workers import WorkerKilledError, Workers, is_repeated

T = TypeVar("T")
R = TypeVar("R")


def run_batch(
    plan: Plan, *, workers: Workers, threads: int | None = None
) -> Generator[tuple[Run, Record]]:
    """Process the files of a plan; yield each when it has ended, with its record in the manifest.

    `threads` is the number of threads of each run that has none.

    At the end, temporary files of killed worker processes are removed.

    Raises
    ------
    OutputError
        The manifest, or the output folder, cannot be written.
    ClusterError
        The cluster of `workers` cannot be used, or its scheduler has ended.
    """
    make_folder(plan.folder)
    runs = [
        replace(run, threads=number, codec_threads=number)
        for run in plan.runs
        for number in (run.threads or threads,)
    ]
    function = partial(_process, identity=plan.identity)
    try:
        with (
            open_manifest(plan.manifest) as add,
            closing(each_once(function, runs, workers, _replacing)) as results,
        ):
            for run, result in results:
                record = result or record_of_killed(run, plan.identity)
                add(record)
                yield run, record
        write_totals(plan)
    finally:
        paths = [output.path for run in runs for output in run.outputs]
        for folder in {path.parent for path in paths} | set(filter(os.path.isdir, paths)):
            remove_stale(folder)


def write_totals(plan: Plan) -> None:
    """Write the files over all videos, from the outputs that exist. Raises `OutputError`."""
    written = read_written(plan.manifest)
    for total in plan.totals:
        parts = {}
        for name, path in total.outputs.items():
            if os.path.exists(path):  # noqa: PTH110  # a name may be too long for `Path.exists`
                place = Path(os.path.relpath(path, total.path.parent))
                known = written.get(os.path.realpath(path))
                parts[name] = VideoPart(path, place, known and known.summary)
        with OutputFiles(overwrite=True) as files, output_errors(total.path):
            total.made_by.write(parts, files.stage(total.path))


def _process(run: Run, *, identity: Identity) -> Record:
    return process_file(_replacing(run) if is_repeated() else run, identity=identity)


def _replacing(run: Run) -> Run:
    """Return a run that replaces its outputs: when its process was killed, it may have ended."""
    return replace(run, overwrite=True)


def each_once(
    function: Callable[[T], R], items: Sequence[T], workers: Workers, again: Callable[[T], T]
) -> Generator[tuple[T, R | None]]:
    """Yield every item with its result, in the order in which they end.

    The result is None for an item that kills its worker process. When a process is killed, several
    items may be in work, and any of them may be the cause. They are repeated at the end, one by
    one, so that only the cause is blamed; `again` returns what is then done in place of an item.
    """
    left = list(items)
    suspects: list[T] = []
    while left:
        ended: set[int] = set()
        try:
            with closing(workers.map(function, left)) as results:
                for number, result in results:
                    ended.add(number)
                    yield left[number], result
        except WorkerKilledError as error:
            suspects += (left[number] for number in sorted(error.lost))
            ended |= error.lost
        left = [item for number, item in enumerate(left) if number not in ended]
    for item in suspects:
        repeated: R | None = None
        with suppress(WorkerKilledError):
            ((_, repeated),) = workers.map(function, [again(item)])
        yield item, repeated
