"""Run a planned batch: process every file, and write its record when it has ended."""

import os
from collections.abc import Generator
from contextlib import closing
from dataclasses import replace
from functools import partial

from vdet.batch.manifest import Record, open_manifest, read_batch
from vdet.batch.plan import Plan
from vdet.batch.task import known_outputs, new_record, process_file
from vdet.files import OutputFiles, make_folder, output_errors, remove_stale
from vdet.run.video import Run
from vdet.workers import Workers, call_all


def run_batch(
    plan: Plan, *, workers: Workers, threads: int | None = None
) -> Generator[tuple[Run, Record]]:
    """Process the files of a plan; yield each when it has ended, with its record in the manifest.

    `threads` is the number of threads of each run that has none.

    At the end, the files over all videos are written, and temporary files of killed worker
    processes are removed.

    Raises
    ------
    OutputError
        The manifest, or the output folder, cannot be written.
    ClusterError
        The cluster of `workers` cannot be used, or its scheduler has ended.
    """
    make_folder(plan.folder)
    runs = [replace(run, threads=run.threads or threads) for run in plan.runs]
    function = partial(process_file, folder=plan.folder)
    try:
        with (
            open_manifest(plan.folder) as add,
            closing(call_all(function, runs, workers)) as results,
        ):
            for run, result in results:
                record = result or _record_of_killed(run)
                add(record)
                yield run, record
            _write_totals(plan)
    finally:
        paths = [output.path for run in runs for output in run.outputs]
        for folder in {path.parent for path in paths} | set(filter(os.path.isdir, paths)):
            remove_stale(folder)


def _record_of_killed(run: Run) -> Record:
    error = f"{run.source}: its process was killed, or crashed; it may have run out of memory"
    return replace(new_record(run), error=error)


def _write_totals(plan: Plan) -> None:
    """Write the files over all videos, from what records say of the outputs that exist."""
    known = known_outputs(read_batch(plan.folder)) if plan.totals else {}
    runs = sorted((*plan.runs, *plan.skipped), key=lambda run: run.outputs[0].path)
    for number, (path, total, ending) in plan.totals.items():
        summaries = {}
        for output in (run.outputs[number] for run in runs):
            written = known.get(os.path.realpath(output.path))
            if written and os.path.exists(output.path):  # noqa: PTH110  # too long a name
                name = output.path.relative_to(plan.folder).as_posix()
                summaries[name.removesuffix(ending)] = written[-1].summary
        with OutputFiles(overwrite=True) as files, output_errors(path):
            total.write(summaries, files.stage(path))
