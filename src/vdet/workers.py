"""Call a function for many items in parallel, in processes of this machine or of a Dask cluster."""

import contextlib
import logging
import math
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from vdet.errors import INTERRUPTED, ClusterError, needing

T = TypeVar("T")
R = TypeVar("R")
Submit = Callable[..., Future[Any]]

PARENT_CHECK_INTERVAL = 0.5  # seconds
SINGLE_THREADED = {"OPENBLAS_NUM_THREADS": "1", "OPENCV_FOR_THREADS_NUM": "1"}
"""Variables that limit libraries to one thread, because frames and files run in parallel."""
ENVIRONMENT = {
    **SINGLE_THREADED,
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "PYTHONSAFEPATH": "1",  # no module is imported from the current folder
}

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # of malloc.h

QUOTA = Path("/sys/fs/cgroup/cpu.max")
"""CPU quota and period of this process's control group (cgroup v2)."""


def core_count() -> int:
    """Return the number of cores that this process may use, by its affinity and control group."""
    has_affinity = hasattr(os, "sched_getaffinity")
    cores = len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count() or 1
    with contextlib.suppress(OSError, ValueError):  # ValueError: "max", no limit
        quota, period = map(int, QUOTA.read_text("utf-8").split())
        return min(cores, math.ceil(quota / period))
    return cores


def limit_library_threads() -> None:
    """Apply `SINGLE_THREADED` in a process that has already loaded the libraries."""
    import cv2
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    threadpool_limits(1)


IMAGES = 32_000_000, 64_000_000
"""Limits for `return_freed_memory` with which each image reuses the memory of an earlier one.

Allocating new memory takes longer than decoding an image into it.
"""


def return_freed_memory(minimum: int = 1_000_000, at_end: int = 16_000_000) -> None:
    """Let glibc return freed memory to the system, with limits in bytes.

    Blocks of at least `minimum`, such as frames, are returned, and the end of the heap once
    `at_end` of it are free. By default glibc raises its limit to 32 MB, and keeps frames in gaps of
    the heap. Does nothing with other C libraries.
    """
    import ctypes

    with contextlib.suppress(AttributeError, OSError, TypeError):
        set_limit = ctypes.CDLL(None).mallopt
        set_limit(_M_MMAP_THRESHOLD, minimum)
        set_limit(_M_TRIM_THRESHOLD, at_end)


class Workers(Protocol):
    """Processes that work in parallel."""

    @property
    def at_once(self) -> float:
        """Maximum number of items in work at a time."""

    def open(self) -> contextlib.AbstractContextManager[Submit]:
        """Start them or connect to them; yield the `submit` method of an executor."""


def call_all(
    function: Callable[[T], R], items: Iterable[T], workers: Workers
) -> Generator[tuple[T, R | None]]:
    """Yield every item with its result, in order of completion.

    The result is None for an item that kills its process. When a process is killed, any of the
    items in work may be the cause. They are repeated at the end, one by one, to find the cause. An
    error raised by `function` is raised here.
    """
    suspects: list[T] = []
    for item, result in _call(function, items, workers):
        if result is not None:
            yield item, result
        else:
            suspects.append(item)
    for item in suspects:
        yield from _call(function, [item], workers)


def _call(
    function: Callable[[T], R], items: Iterable[T], workers: Workers
) -> Generator[tuple[T, R | None]]:
    """Yield every item with its result; None for those in work when a process was killed."""
    waiting = deque(items)
    while waiting:
        in_work: dict[Future[R], T] = {}
        is_broken = False
        with workers.open() as submit:
            while in_work or (waiting and not is_broken):
                while waiting and not is_broken and len(in_work) < workers.at_once:
                    try:
                        in_work[submit(function, waiting[0])] = waiting[0]
                        waiting.popleft()
                    except BrokenExecutor:
                        is_broken = True
                for future in wait(in_work, return_when=FIRST_COMPLETED).done:
                    item = in_work.pop(future)
                    is_lost = _is_killed(future.exception())
                    is_broken = is_broken or is_lost
                    yield item, None if is_lost else future.result()


def _is_killed(error: BaseException | None) -> bool:
    """Return whether an error means that a process was killed or crashed."""
    return isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker"  # of Dask


@dataclass(frozen=True, slots=True)
class LocalProcesses:
    """`at_once` processes of this machine; only the main thread can start them.

    They ignore Ctrl-C in a terminal, because their parent ends them, and end soon after it.
    """

    at_once: int

    @contextlib.contextmanager
    def open(self) -> Iterator[Submit]:
        """Start the processes; at the end of the block they are killed."""
        from loky import ProcessPoolExecutor

        begin = {"initializer": _initialize, "initargs": (os.getpid(),), "env": ENVIRONMENT}
        executor = ProcessPoolExecutor(self.at_once, **begin)

        def submit(*call: Any) -> Future[Any]:
            future: Future[Any] = executor.submit(*call)
            while not (future.running() or future.done()):
                time.sleep(0.001)  # loky cannot end while an item is on its way to a process
            return future

        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)  # for the processes that start
        try:
            submit(int)
        finally:
            signal.signal(signal.SIGINT, handler)
        try:
            yield submit
        finally:
            executor.shutdown(kill_workers=True)


def _initialize(parent: int) -> None:
    """Run in a new worker process: end when the process `parent` has ended."""

    def end_with_parent() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_CHECK_INTERVAL)
        os._exit(INTERRUPTED)

    threading.Thread(target=end_with_parent, daemon=True).start()


@dataclass(frozen=True, slots=True)
class DaskCluster:
    """All workers of the Dask scheduler at `address`; they must see files at the same paths.

    The scheduler must answer within `timeout` seconds, and have a worker within as many more. It
    repeats an item whose worker was lost (`distributed.scheduler.allowed-failures`).
    """

    address: str
    timeout: float = 10.0
    at_once: float = math.inf

    @contextlib.contextmanager
    def open(self) -> Iterator[Submit]:
        """Connect to the scheduler; at the end of the block it drops items that have not begun.

        Raises
        ------
        PackageError
            Dask is not installed.
        ClusterError
            The scheduler does not answer, has no worker, or ends.
        """
        with needing("dask"):
            from distributed import Client
        for name in ("distributed", "distributed.client"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # errors are raised
        with contextlib.ExitStack() as stack:
            try:
                client = Client(self.address, timeout=self.timeout, set_as_default=False)
                stack.enter_context(client).wait_for_workers(1, timeout=self.timeout)
            except (OSError, ValueError) as error:  # ValueError: not the form of an address
                advice = "start them with `dask scheduler` and `dask worker`"
                lack = f"no Dask scheduler with a worker answers; {advice}"
                raise ClusterError(f"{self.address}: {lack}") from error
            try:
                yield client.get_executor(pure=False).submit
            except CancelledError as error:
                raise ClusterError(f"{self.address}: the scheduler has ended; run again") from error
