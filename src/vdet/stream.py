"""Threads with bounded queues: items keep their order, an error anywhere ends everything.

Each part is a context manager; when its block is left, however, its threads have ended.
"""

import contextlib
import queue
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

import cv2
from threadpoolctl import threadpool_limits

T = TypeVar("T")
R = TypeVar("R")

_PATIENCE = 0.1  # seconds between looks at whether all is over


class _End:
    """Comes through a queue after the last item, with the error that ended them, if one did."""

    def __init__(self, error: BaseException | None = None) -> None:
        self.error = error


class _Channel(Generic[T]):
    """A bounded queue that its reader can give up."""

    def __init__(self, depth: int) -> None:
        self._queue: queue.Queue[T | _End] = queue.Queue(depth)
        self._given_up = threading.Event()

    def put(self, item: T | _End) -> bool:
        """Wait for room; return False if nobody will read any more."""
        while not self._given_up.is_set():
            with contextlib.suppress(queue.Full):
                self._queue.put(item, timeout=_PATIENCE)
                return True
        return False

    def give_up(self) -> None:
        self._given_up.set()

    def __iter__(self) -> Iterator[T]:
        while not isinstance(item := self._queue.get(), _End):
            yield item
        if item.error is not None:
            raise item.error


@contextlib.contextmanager
def ahead(items: Iterable[T], depth: int = 4) -> Iterator[Iterator[T]]:
    """Go through `items` in a thread; at most `depth` wait for the reader, and one for room."""
    channel: _Channel[T] = _Channel(depth)

    def fill() -> None:
        try:
            for item in items:
                if not channel.put(item):
                    return
            channel.put(_End())
        except BaseException as error:
            channel.put(_End(error))

    thread = threading.Thread(target=fill, name="vdet-ahead", daemon=True)
    thread.start()
    try:
        yield iter(channel)
    finally:
        channel.give_up()
        thread.join()


@contextlib.contextmanager
def behind(take: Callable[[T], object], depth: int = 4) -> Iterator[Callable[[T], None]]:
    """Give a function that hands items to `take` in a thread, at most `depth` of them waiting.

    An error of `take` is raised by the next call, or when the block ends.
    """
    channel: _Channel[T] = _Channel(depth)
    failures: list[BaseException] = []

    def drain() -> None:
        try:
            for item in channel:
                take(item)
        except BaseException as error:
            failures.append(error)
            channel.give_up()

    def hand_over(item: T) -> None:
        if not channel.put(item):
            raise failures[0]

    thread = threading.Thread(target=drain, name="vdet-behind", daemon=True)
    thread.start()
    try:
        yield hand_over
    finally:
        channel.put(_End())
        thread.join()
    if failures:
        raise failures[0]


@contextlib.contextmanager
def each_with(
    function: Callable[[T], R], items: Iterable[T], threads: int
) -> Iterator[Iterator[tuple[T, R]]]:
    """Pair items with what `function` makes of them, some in parallel, all in order."""
    with ThreadPoolExecutor(threads, thread_name_prefix="vdet-search") as pool:

        def pairs() -> Iterator[tuple[T, R]]:
            running: deque[tuple[T, Future[R]]] = deque()
            for item in items:
                running.append((item, pool.submit(function, item)))
                if len(running) > threads:
                    first, future = running.popleft()
                    yield first, future.result()
            for first, future in running:
                yield first, future.result()

        try:
            yield pairs()
        finally:
            pool.shutdown(cancel_futures=True)


@contextlib.contextmanager
def quiet_libraries() -> Iterator[None]:
    """Keep OpenCV and BLAS to one thread a call: the parallel work is by frames."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        cv2.setNumThreads(threads)
