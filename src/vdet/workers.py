"""Call a function for many items in parallel: in processes of this machine, or on a Dask cluster.

Worker processes of this machine end in order on SIGTERM, ignore Ctrl-C in a terminal (their parent
ends them), and end when their parent has ended.
"""

import contextlib
import itertools
import logging
import math
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeVar

from vdet.errors import INTERRUPTED, ClusterError, check_positive
from vdet.version import __version__

T = TypeVar("T")
R = TypeVar("R")

PARENT_CHECK_INTERVAL = 0.5  # seconds
CLEANUP_TIMEOUT = 10.0  # seconds between a signal and a forced exit
SINGLE_THREADED = {"OPENBLAS_NUM_THREADS": "1", "OPENCV_FOR_THREADS_NUM": "1"}
"""Variables that limit libraries to one thread a call: frames and files are done in parallel."""
ENVIRONMENT = {
    **SINGLE_THREADED,
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "PYTHONSAFEPATH": "1",  # no module is imported from the current folder
}

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # of malloc.h

_GROUPS = Path("/sys/fs/cgroup")
QUOTAS = (
    (_GROUPS / "cpu.max",),
    (_GROUPS / "cpu/cpu.cfs_quota_us", _GROUPS / "cpu/cpu.cfs_period_us"),
)
"""The files of quota and period of this process's control group: version 2, version 1."""


class WorkerKilledError(BrokenExecutor):
    """A worker process was killed or crashed; the items numbered `lost` have no result."""

    def __init__(self, lost: Iterable[int]) -> None:
        super().__init__("a worker process was killed, or crashed")
        self.lost = frozenset(lost)


class Workers(Protocol):
    """Processes that work in parallel."""

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> Generator[tuple[int, R]]:
        """Call `function` for each item; yield the item's number and the result as they end.

        Work begins in the order of the items. When the generator is closed, no further item is
        begun. An error that `function` raises is raised here.

        Raises
        ------
        WorkerKilledError
            A worker process was killed. The items that were in work are lost. Other items without
            a result were not begun.
        """


def core_count() -> int:
    """Return how many cores this process may use: its affinity and its control group limit them."""
    has_affinity = hasattr(os, "sched_getaffinity")
    cores = len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count() or 1
    for files in QUOTAS:
        with contextlib.suppress(OSError, ValueError):  # ValueError: "max", no limit
            quota, period = map(int, " ".join(map(Path.read_text, files)).split())
            if quota > 0:
                cores = min(cores, math.ceil(quota / period))
    return cores


def limit_library_threads() -> None:
    """Do as `SINGLE_THREADED` says in a process that has loaded the libraries."""
    import cv2
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    threadpool_limits(1)


PICTURES = 32_000_000, 64_000_000
"""Limits for `return_freed_memory` with which each picture takes the memory of an earlier one.

New memory takes longer than to decode a picture into it.
"""


def return_freed_memory(least: int = 1_000_000, at_end: int = 16_000_000) -> None:
    """Let glibc return freed memory to the system, with limits in bytes.

    Blocks from `least` on, such as frames, are returned, and the end of the heap once `at_end` of
    it are free. glibc would raise its own limit to 32 MB, and keep frames in the gaps between
    others. With another C library nothing is done.
    """
    import ctypes

    with contextlib.suppress(AttributeError, OSError, TypeError):
        set_limit = ctypes.CDLL(None).mallopt
        set_limit(_M_MMAP_THRESHOLD, least)
        set_limit(_M_TRIM_THRESHOLD, at_end)


def make_workers(jobs: int | None = None, scheduler: str | None = None) -> Workers:
    """Return the cluster of `scheduler` if given, else `jobs` processes; None: one for each core.

    For a single job no further process is started. Raises `ConfigError` for less than one job.
    """
    if scheduler:
        return DaskCluster(scheduler)
    check_positive(jobs=jobs)
    count = jobs or core_count()
    return ThisProcess() if count == 1 else LocalProcesses(count)


@dataclass(frozen=True, slots=True)
class ThisProcess:
    """Works in this process, one item after the other."""

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> Generator[tuple[int, R]]:
        """Yield each item's number and result; see `Workers`."""
        for number, item in enumerate(items):
            yield number, function(item)


@dataclass(frozen=True, slots=True)
class LocalProcesses:
    """`count` processes of this machine; even a `count` of 1 is a process of its own.

    Only the main thread can start them, so that Ctrl-C is left to it.
    """

    count: int

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> Generator[tuple[int, R]]:
        """Yield each item's number and result; see `Workers`."""
        from loky import ProcessPoolExecutor

        count = max(1, min(self.count, len(items)))
        executor = ProcessPoolExecutor(
            count, initializer=_initialize_worker, initargs=(os.getpid(),), env=ENVIRONMENT
        )
        waiting = iter(enumerate(items))
        in_work: dict[Future[R], int] = {}

        def begin(most: int) -> None:
            for number, item in itertools.islice(waiting, most):
                in_work[executor.submit(_run_task, function, item)] = number

        try:
            handler = signal.signal(signal.SIGINT, signal.SIG_IGN)  # for the processes that start
            try:
                begin(self.count)
            finally:
                signal.signal(signal.SIGINT, handler)
            while in_work:
                for future in wait(in_work, return_when=FIRST_COMPLETED).done:
                    result = future.result()
                    yield in_work.pop(future), result
                    begin(1)
        except BrokenExecutor as error:
            raise WorkerKilledError(in_work.values()) from error
        finally:
            while not all(future.running() or future.done() for future in in_work):
                time.sleep(0.001)  # loky cannot end while an item is on its way to a process
            executor.shutdown(kill_workers=bool(in_work))


def _initialize_worker(parent: int) -> None:
    """Run in a new worker process: end when the process `parent` has ended."""
    threading.Thread(target=_end_after, args=(parent,), name="vdet-watch", daemon=True).start()


def _end_after(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PARENT_CHECK_INTERVAL)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(CLEANUP_TIMEOUT)
    os._exit(INTERRUPTED)


def _run_task(function: Callable[[T], R], item: T) -> R:
    """Run in a worker process: on SIGTERM, let `function` clean up, and end the process."""
    handler = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return function(item)
    except KeyboardInterrupt:
        os._exit(INTERRUPTED)
    finally:
        signal.signal(signal.SIGTERM, handler)


@dataclass(frozen=True, slots=True)
class DaskCluster:
    """All workers of the Dask scheduler at `address`; they find inputs and outputs by their paths.

    The scheduler has `connect_timeout` seconds to answer, and then `worker_timeout` seconds to have
    a worker. While there is work, it may be without workers for `lost_timeout` seconds.
    """

    address: str
    connect_timeout: float = 10.0
    worker_timeout: float = 10.0
    lost_timeout: float = 60.0

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> Generator[tuple[int, R]]:
        """Yield each item's number and result; see `Workers`.

        Items that are in work when the generator is closed are finished, their results dropped.

        Raises
        ------
        WorkerKilledError
            After all other items have ended: Dask gave up some, because it lost the workers that
            had them (`distributed.scheduler.allowed-failures`).
        ClusterError
            Dask is not installed, the scheduler does not answer, it has no worker, a worker has
            another version of vdet, or the scheduler or all workers end while there is work.
        """
        with _connection(self) as client:
            from distributed import KilledWorker, as_completed

            futures = client.map(partial(_call_limited, function), items, pure=False)
            numbers = {future.key: number for number, future in enumerate(futures)}
            lost = []
            ended = as_completed(futures, loop=client.loop)
            del futures  # so that the workers drop each result once it was read
            while not ended.is_empty():
                self._wait(ended, client)
                future = next(ended)
                try:
                    result = future.result()
                except KilledWorker:
                    lost.append(numbers[future.key])
                except (CancelledError, OSError) as error:
                    if future.status == "error":
                        raise  # an OSError of the function
                    message = f"{self.address}: the scheduler has ended; run again"
                    raise ClusterError(message) from error
                else:
                    yield numbers[future.key], result
            if lost:
                raise WorkerKilledError(lost)

    def _wait(self, ended: Any, client: Any) -> None:
        """Wait until an item has ended; raise `ClusterError` if there is no worker for long."""
        seen = time.monotonic()
        while not ended.has_ready():
            time.sleep(0.05)
            with contextlib.suppress(OSError):  # the scheduler has ended, and so have all items
                if client.nthreads():
                    seen = time.monotonic()
            if time.monotonic() > seen + self.lost_timeout:
                raise ClusterError(f"{self.address}: all workers have ended; start others")


def _call_limited(function: Callable[[T], R], item: T) -> R:
    limit_library_threads()
    return function(item)


def is_repeated() -> bool:
    """Return whether Dask has begun this task before, with a worker that has ended since.

    The scheduler keeps a note of each task that asks. Outside a Dask worker the answer is False.
    """
    if "distributed" not in sys.modules:
        return False
    from distributed import Event, get_worker

    try:
        begun = Event(f"vdet-{get_worker().get_current_task()}")
    except ValueError:  # this is no worker
        return False
    was_begun = bool(begun.is_set())
    begun.set()
    return was_begun


@contextlib.contextmanager
def _connection(cluster: DaskCluster) -> Iterator[Any]:
    """Give a client of a cluster whose workers all have this version of vdet."""
    address = cluster.address
    try:
        from distributed import Client
        from distributed.versions import VersionMismatchWarning
    except ImportError as error:
        raise ClusterError("--scheduler needs Dask; pip install dask distributed") from error
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # errors are raised
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", VersionMismatchWarning)  # that of vdet counts
        try:
            client = Client(address, timeout=cluster.connect_timeout, set_as_default=False)
        except (OSError, ValueError) as error:  # ValueError: not the form of an address
            raise ClusterError(
                f"{address}: no Dask scheduler answers there; start one with `dask scheduler`"
            ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=cluster.worker_timeout)
        except TimeoutError as error:
            raise ClusterError(f"{address}: has no worker; start some (dask worker)") from error
        for worker, version in client.run(_version, on_error="return").items():
            if version != __version__:
                has = f"vdet {version}" if isinstance(version, str) else f"no vdet ({version})"
                here = f"here is vdet {__version__}; install one version everywhere"
                raise ClusterError(f"{worker}: has {has}, {here}")
        yield client


def _version() -> str:
    return __version__
