"""Work in parallel, in threads, and in processes of this machine or of a Dask cluster; progress.

Threads read, search and write: items keep their order, and one error ends all. Each kind of them is
a context manager. When its block ends, its threads have ended, with one exception: a thread that
hangs in a read or write (for example on a network disk that is gone) is abandoned after
`JOIN_TIMEOUT`, with the files that only it has open.
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
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from vdet.errors import INTERRUPTED, BatchError, needing

T = TypeVar("T")
R = TypeVar("R")
S = TypeVar("S")

Advance = Callable[[int], object]
"""Called with the number of items done since the last call."""
Progress = Callable[[str, int | None], Advance]
"""Called at the start of each stage of the work: its name, empty if there is only one, and the
expected number of items, None if it is unknown.
"""

PARENT_CHECK_INTERVAL = 0.5  # seconds
SINGLE_THREADED = {"OPENBLAS_NUM_THREADS": "1", "OPENCV_FOR_THREADS_NUM": "1"}
"""Variables that limit libraries to one thread, because frames and files run in parallel."""

JOIN_TIMEOUT = 2.0  # seconds for a thread to end
DEPTH = 2  # items queued between two threads
_END = object()  # follows the last item
QUOTA = Path("/sys/fs/cgroup/cpu.max")
"""CPU quota and period of this process's control group (cgroup v2)."""


def core_count() -> int:
    """Return the number of cores that this process may use, by its affinity and control group."""
    cores = len(os.sched_getaffinity(0))
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


def call_all(
    function: Callable[[T], R], items: Iterable[T], workers: "Workers"
) -> Generator[tuple[T, R | None]]:
    """Yield every item with its result, in order of completion.

    The result is None for an item that kills its process. When a process is killed, any of the
    items in work may be the cause. They are called again, one by one, to find it, so an item may be
    called twice. An error raised by `function` is raised here. Only the main thread can call this.
    """
    remaining = dict(enumerate(items))
    with workers.open() as backend:
        while remaining:
            for number, result in _call(function, remaining, backend, workers.at_once):
                yield remaining.pop(number), result
            for number in list(remaining)[: workers.at_once]:  # a process was killed
                item = remaining.pop(number)
                yield item, dict(_call(function, {number: item}, backend, 1)).get(number)


def _call(
    function: Callable[[T], R], items: Mapping[int, T], backend: Any, at_once: int | None
) -> Generator[tuple[int, R]]:
    """Yield the results of numbered items; those lost with a killed process are missing."""
    from joblib import Parallel, delayed

    parallel = Parallel(
        n_jobs=max(2, at_once or 0),  # one job would run in this process
        backend=backend,
        pre_dispatch=at_once or "all",
        batch_size=1,
        return_as="generator_unordered",
    )
    calls = [delayed(_numbered)(number, function, item) for number, item in items.items()]
    with contextlib.suppress(BrokenExecutor), contextlib.ExitStack() as stack:
        with blocked_interrupts():  # also in the processes that start
            results = parallel(calls)
            stack.callback(_close, results)
        yield from filter(None, results)


@contextlib.contextmanager
def blocked_interrupts() -> Iterator[None]:
    """Delay Ctrl-C to the end of the block; processes that start in the block never get it."""
    from multiprocessing.resource_tracker import ensure_running

    ensure_running()  # if it started in the block, it would unblock signals
    earlier = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, earlier)


def _close(results: Generator[Any]) -> None:
    with warnings.catch_warnings(action="ignore"):  # about calls that it cancels
        results.close()


def _numbered(number: int, function: Callable[[T], R], item: T) -> tuple[int, R]:
    return number, function(item)


@dataclass(frozen=True, slots=True)
class LocalProcesses:
    """`at_once` processes of this machine.

    They ignore Ctrl-C in a terminal, because their parent ends them, and end when it does.
    """

    at_once: int

    @contextlib.contextmanager
    def open(self) -> Iterator[Any]:
        """Yield a backend that starts the processes; at the end of the block they are killed."""
        from joblib.externals.loky import get_reusable_executor
        from joblib.parallel import LokyBackend

        try:
            yield LokyBackend(
                inner_max_num_threads=1, initializer=_initialize, initargs=(os.getpid(),)
            )
        finally:
            get_reusable_executor().shutdown(kill_workers=True)


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

    The scheduler must respond within `timeout` seconds, and have a worker within as many more. It
    repeats an item whose worker was lost (`distributed.scheduler.allowed-failures`).
    """

    address: str
    timeout: float = 10.0
    at_once: int | None = None

    @contextlib.contextmanager
    def open(self) -> Iterator[Any]:
        """Connect to the scheduler; at the end of the block it drops items that have not begun.

        Raises
        ------
        PackageError
            Dask is not installed.
        BatchError
            The scheduler does not respond, has no worker, or ends.
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
                lack = f"no Dask scheduler with a worker responds; {advice}"
                raise BatchError(f"{self.address}: {lack}") from error
            try:
                yield _dask_backend(client)
            except CancelledError as error:
                raise BatchError(f"{self.address}: the scheduler has ended; run again") from error


Workers = LocalProcesses | DaskCluster
"""Processes that work in parallel: `at_once` items, or all if that is None."""


def _dask_backend(client: Any) -> Any:
    """Return a backend of joblib for a Dask client.

    With joblib's own one, a call whose worker was killed never ends.
    """
    from distributed import KilledWorker
    from joblib.parallel import ParallelBackendBase

    class DaskBackend(ParallelBackendBase):  # type: ignore[misc]
        supports_retrieve_callback = True

        def effective_n_jobs(self, n_jobs: int) -> int:
            return n_jobs

        def submit(self, call: Callable[[], R], callback: Callable[..., object]) -> Future[R]:
            future: Future[R] = executor.submit(call)
            future.add_done_callback(callback)
            return future

        def retrieve_result_callback(self, future: Future[R]) -> R | list[None]:
            try:
                return future.result()
            except KilledWorker:
                return [None]

    executor = client.get_executor(pure=False)
    return DaskBackend()


class SearchThreads(ThreadPoolExecutor):
    """Threads for the search; at the end of the block, calls that have not begun are cancelled."""

    def __init__(self, count: int) -> None:
        super().__init__(count, thread_name_prefix="vdet-search")
        self._count = count

    def __exit__(self, *_: object) -> None:
        self.shutdown(cancel_futures=True)

    def map_ordered(
        self, function: Callable[[T], R], items: Iterable[T], ahead: int | None = None
    ) -> Generator[tuple[T, R]]:
        """Yield items with the results of `function`, in order.

        `ahead` items are in work while the caller uses a result; None: one for every thread.
        """
        ahead = self._count if ahead is None else ahead
        running: deque[tuple[T, Future[R]]] = deque()
        for item in items:
            running.append((item, self.submit(function, item)))
            if len(running) > ahead:
                first, future = running.popleft()
                yield first, future.result()
        for item, future in running:
            yield item, future.result()


@contextlib.contextmanager
def _thread(name: str) -> Iterator[ThreadPoolExecutor]:
    """Yield a thread that makes calls in turn.

    At the end of the block, pending calls are still made, but waited for only `JOIN_TIMEOUT`.
    """
    thread = ThreadPoolExecutor(1, name)
    try:
        yield thread
    finally:
        with contextlib.suppress(RuntimeError):  # the interpreter exits, and its threads have ended
            hangs = wait([thread.submit(int)], JOIN_TIMEOUT).not_done
            thread.shutdown(wait=not hangs)


@contextlib.contextmanager
def read_async(source: contextlib.AbstractContextManager[S]) -> Iterator[tuple[S, Iterator[Any]]]:
    """Yield the value of a context manager, and an iterator over that value.

    A thread enters the context manager, iterates at most `DEPTH` items ahead of the consumer, and
    exits.
    """
    ahead: deque[Future[Any]] = deque()
    with _thread("vdet-read") as thread:
        try:
            value = thread.submit(source.__enter__).result()
            iterator: Iterator[Any] = iter(value)  # type: ignore[call-overload]
            ahead.extend(thread.submit(next, iterator, _END) for _ in range(DEPTH))

            def items() -> Iterator[Any]:
                while (item := ahead.popleft().result()) is not _END:
                    ahead.append(thread.submit(next, iterator, _END))
                    yield item

            yield value, items()
        finally:
            for future in ahead:
                future.cancel()
            with contextlib.suppress(RuntimeError):  # the interpreter exits
                thread.submit(source.__exit__, None, None, None)


@contextlib.contextmanager
def write_async(
    take: Callable[[T], object], *, within: contextlib.AbstractContextManager[object]
) -> Iterator[Callable[[T], None]]:
    """Yield a function that passes items to `take` in a thread; at most `DEPTH` items wait.

    The thread enters and exits the context manager `within`, with the error of the block if there
    is one. An error in the thread is raised by a later call, or when the block ends.
    """
    with _thread("vdet-write") as thread:
        waiting: deque[Future[Any]] = deque([thread.submit(within.__enter__)])

        def put(item: T) -> None:
            while waiting and (len(waiting) >= DEPTH or waiting[0].done()):
                waiting.popleft().result()
            waiting.append(thread.submit(take, item))

        try:
            yield put
            for future in waiting:
                future.result()
        except BaseException:
            thread.submit(within.__exit__, *sys.exc_info())
            raise
        thread.submit(within.__exit__, None, None, None).result()


def no_progress(_: str, __: int | None) -> Advance:
    """Show no progress."""
    return lambda _: None


def reporting(report: Callable[[int, int | None], object]) -> Progress:
    """Return a `Progress` that calls a function with the number of items done and the total."""

    def begin(_: str, total: int | None) -> Advance:
        done = itertools.count(1)
        return lambda count: [report(next(done), total) for _ in range(count)]

    return begin
