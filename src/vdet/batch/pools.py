"""Where the files of a batch are processed: by processes of this machine, or on a Dask cluster."""

import os
import warnings
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, TypeVar

from vdet.cluster import on_cluster
from vdet.workers import end_with, ignore_sigint, work

T = TypeVar("T")
R = TypeVar("R")


class Pool(Protocol):
    """Processes that work side by side."""

    def map(self, function: Callable[[T], R], items: Iterable[T]) -> Generator[R]:
        """Yield what `function` makes of the items, as they end.

        Raises
        ------
        concurrent.futures.BrokenExecutor
            A process was killed; what others were at is lost too.
        """


@dataclass(frozen=True, slots=True)
class Processes:
    """`count` processes of this machine, one item each."""

    count: int

    def map(self, function: Callable[[T], R], items: Iterable[T]) -> Generator[R]:
        """Yield what `function` makes of the items, as they end."""
        import joblib

        parallel = joblib.Parallel(
            n_jobs=max(2, self.count),  # for one, joblib would work in this very process …
            pre_dispatch=self.count,  # … but what is begun ahead keeps so many busy, and no more
            batch_size=1,
            max_nbytes=None,
            return_as="generator_unordered",
            initializer=end_with,
            initargs=(os.getpid(),),
        )
        with parallel:
            with ignore_sigint():
                results = parallel(joblib.delayed(partial(work, function))(item) for item in items)
            yield from _ended_with_us(results)


@dataclass(frozen=True, slots=True)
class Cluster:
    """All workers of the Dask scheduler at `address`."""

    address: str

    def map(self, function: Callable[[T], R], items: Iterable[T]) -> Generator[R]:
        """Yield what `function` makes of the items, as they end. Raises `ClusterError` too."""
        import joblib

        with on_cluster(self.address):
            parallel = joblib.Parallel(batch_size=1, return_as="generator_unordered")
            yield from _ended_with_us(parallel(joblib.delayed(function)(item) for item in items))


def _ended_with_us(results: Generator[Any]) -> Generator[Any]:
    """Pass results on; if they are given up, end the work without joblib's word of advice."""
    try:
        yield from results
    except GeneratorExit:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            results.close()
        raise
