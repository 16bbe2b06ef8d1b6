"""Run a planned batch: every file once, records as they end, nothing left behind."""

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import closing
from functools import partial
from typing import TypeVar

from vdet.batch.manifest import Origin, Record, appending
from vdet.batch.plan import Plan
from vdet.batch.pools import Pool
from vdet.batch.task import Work, process_file, record_of_killed
from vdet.files import make_folder, remove_stale
from vdet.pipeline.loop import VideoJob

T = TypeVar("T")
R = TypeVar("R")


def run_batch(
    plan: Plan, work: Work, origin: Origin, *, pool: Pool
) -> Generator[tuple[VideoJob, Record]]:
    """Do the jobs of a plan; yield each when it has ended, with its record in the manifest.

    Raises
    ------
    OutputError
        The manifest, or the output folder, cannot be written.
    ClusterError
        The cluster of `pool` cannot be used, or no more.
    """
    make_folder(plan.folder)
    function = partial(process_file, work=work)
    try:
        with (
            appending(plan.manifest, origin) as add,
            closing(each_once(function, plan.jobs, pool)) as results,
        ):
            for job, result in results:
                record = result or record_of_killed(job)
                add(record)
                yield job, record
    finally:
        for folder in {output.path.parent for job in plan.jobs for output in job.outputs}:
            remove_stale(folder)


def each_once(
    function: Callable[[T], R], items: Sequence[T], pool: Pool
) -> Generator[tuple[T, R | None]]:
    """Yield every item with what `function` makes of it; None if that killed the process.

    When a process is killed the items that were being worked at are put aside, and done in the end
    one after the other: so it is known which of them is to blame, and the others are not.
    """
    left = dict(enumerate(items))
    aside: set[int] = set()
    while chosen := {number: item for number, item in left.items() if number not in aside}:
        begun: list[int] = []
        try:
            for number, result in pool.map(partial(_numbered, function), _noting(chosen, begun)):
                yield left.pop(number), result
        except BrokenExecutor:
            aside.update(left.keys() & begun)
    for number in sorted(aside):
        yield left[number], _alone(function, left[number], pool)


def _alone(function: Callable[[T], R], item: T, pool: Pool) -> R | None:
    try:
        (result,) = pool.map(function, [item])
    except BrokenExecutor:
        return None
    return result


def _numbered(function: Callable[[T], R], numbered: tuple[int, T]) -> tuple[int, R]:
    number, item = numbered
    return number, function(item)


def _noting(items: Mapping[int, T], begun: list[int]) -> Iterator[tuple[int, T]]:
    for number, item in items.items():
        begun.append(number)
        yield number, item
