"""Threads with bounded queues: items keep their order, an error in one thread ends all.

Each part is a context manager. When its block ends, its threads have ended. There is one exception:
a thread that hangs in a read or write (for instance on a network disk that is gone) is abandoned
after `JOIN_TIMEOUT`, together with the files that only it has open.
"""

import contextlib
import queue
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext, suppress
from typing import Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")

POLL_INTERVAL = 0.1  # seconds between checks whether the other side has ended
JOIN_TIMEOUT = 2.0  # seconds that a thread gets to end
_AHEAD = 8
"""Largest number of items that `map_ordered` takes ahead for each thread."""


class _End:
    """The last entry of a queue, with the error that ended the items, if there was one."""

    def __init__(self, error: BaseException | None = None) -> None:
        self.error = error


class StalledError(Exception):
    """The other side did not give or take an item in time."""


class _ClosedError(Exception):
    """Ends a thread when the other side has ended with an error."""


class _Channel(Generic[T]):
    """A bounded queue that either side can close."""

    def __init__(self, depth: int) -> None:
        self._queue: queue.Queue[T | _End] = queue.Queue(depth)
        self._closed = threading.Event()
        self.done = 0  # items whose taker has come back for the next one

    def put(self, item: T | _End, timeout: float | None = None) -> bool:
        """Wait for room; return False if the queue is closed."""
        waited = 0.0
        while not self._closed.is_set():
            with suppress(queue.Full):
                self._queue.put(item, timeout=POLL_INTERVAL)
                return True
            waited += POLL_INTERVAL
            if timeout is not None and waited >= timeout:
                raise StalledError
        return False

    def take(self, timeout: float | None = None) -> Iterator[T]:
        while not isinstance(item := self._next(timeout), _End):
            yield item
            self.done += 1
        if item.error is not None:
            raise item.error

    def close(self) -> None:
        self._closed.set()

    def _next(self, timeout: float | None) -> T | _End:
        try:
            item = self._queue.get(timeout=timeout)
        except queue.Empty:
            raise StalledError from None
        return _End(_ClosedError()) if self._closed.is_set() else item


@contextlib.contextmanager
def prefetch(
    items: Iterable[T], depth: int = 4, *, timeout: float | None = None
) -> Iterator[Iterator[T]]:
    """Take `items` in a thread, ahead of the reader; at most `depth` wait, and one for room.

    A generator is closed in that thread too. If the next item does not come within `timeout`
    seconds, `StalledError` is raised.
    """
    channel: _Channel[T] = _Channel(depth)

    def fill() -> None:
        try:
            with _closing(items):
                for item in items:
                    if not channel.put(item):
                        return
            channel.put(_End())
        except BaseException as error:
            channel.put(_End(error))

    thread = threading.Thread(target=fill, name="vdet-prefetch", daemon=True)
    thread.start()
    try:
        yield channel.take(timeout)
    finally:
        channel.close()
        thread.join(JOIN_TIMEOUT)


def run_in_thread(call: Callable[[], T], *, timeout: float | None = None) -> T:
    """Return the result of `call`; it runs in a thread, so that Ctrl-C works even if it hangs.

    `StalledError` is raised if it does not end within `timeout` seconds.
    """
    with prefetch((call() for _ in range(1)), timeout=timeout) as results:
        return next(results)


@contextlib.contextmanager
def write_async(
    take: Callable[[T], object],
    depth: int = 4,
    *,
    within: AbstractContextManager[object] | None = None,
    timeout: float | None = None,
    extra: Callable[[], float] = lambda: 0.0,
) -> Iterator[Callable[[T], None]]:
    """Give a function that passes items to `take` in a thread; at most `depth` items wait.

    The thread enters and leaves the context manager `within`, with an error if the block ends with
    one. An error in the thread is raised by the next call, or when the block ends. A call raises
    `StalledError` if there is no room within `timeout` seconds. So does the end of the block if the
    last items, or leaving `within`, get no further within `timeout` and the `extra` seconds.
    """
    channel: _Channel[T] = _Channel(depth)
    failures: list[BaseException] = []

    def drain() -> None:
        try:
            with within or nullcontext():
                for item in channel.take():
                    take(item)
        except BaseException as error:
            failures.append(error)
            channel.close()

    def put(item: T) -> None:
        if not channel.put(item, timeout):
            raise failures[0]

    thread = threading.Thread(target=drain, name="vdet-write", daemon=True)
    thread.start()
    try:
        yield put
        channel.put(_End(), timeout)
        _join(thread, channel, None if timeout is None else timeout + extra())
    except BaseException:
        with suppress(StalledError):
            channel.put(_End(_ClosedError()), JOIN_TIMEOUT)
        thread.join(JOIN_TIMEOUT)
        channel.close()
        raise
    if failures:
        raise failures[0]


def _join(thread: threading.Thread, channel: _Channel[T], timeout: float | None) -> None:
    """Wait for the end of a thread that takes items, as long as it gets on."""
    done = -1
    while thread.is_alive():
        if channel.done == done:
            raise StalledError
        done = channel.done
        thread.join(timeout)


def _closing(items: Iterable[object]) -> AbstractContextManager[object]:
    return contextlib.closing(items) if isinstance(items, Generator) else nullcontext()


@contextlib.contextmanager
def map_ordered(
    function: Callable[[T], R],
    items: Iterable[T],
    threads: int,
    *,
    is_work: Callable[[T], bool] = lambda _: True,
) -> Iterator[Iterator[tuple[T, R]]]:
    """Pair items with the results of `function`, computed in parallel, in their order.

    Items are taken until there is one for each thread and one more. Those for which `is_work` is
    false take no time and do not count, but at most `_AHEAD` items are taken for each thread.
    """
    running: deque[tuple[T, Future[R]]] = deque()

    with ThreadPoolExecutor(threads, thread_name_prefix="vdet-search") as pool:

        def pairs() -> Iterator[tuple[T, R]]:
            work = 0
            for item in items:
                running.append((item, pool.submit(function, item)))
                work += is_work(item)
                while work > threads or len(running) > _AHEAD * threads:
                    first, future = running.popleft()
                    work -= is_work(first)
                    yield first, future.result()
            while running:
                first, future = running.popleft()
                yield first, future.result()

        try:
            yield pairs()
        finally:
            pool.shutdown(cancel_futures=True)
