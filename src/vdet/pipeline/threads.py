"""Threads with bounded queues: items keep their order, an error anywhere ends everything.

Each part is a context manager; when its block is left, however, its threads have ended. The one
exception: a thread that hangs in a read or write which never ends (a network disk that is gone) is
left alone after a moment, together with what it alone has open.
"""

import contextlib
import queue
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from typing import Generic, TypeVar

import cv2
from threadpoolctl import threadpool_limits

T = TypeVar("T")
R = TypeVar("R")

_TICK = 0.1  # seconds between looks at whether all is over
_MOMENT = 2.0  # seconds that a thread is given to end, once all is over


class _End:
    """Comes through a queue after the last item, with the error that ended them, if one did."""

    def __init__(self, error: BaseException | None = None) -> None:
        self.error = error


class Stalled(Exception):  # noqa: N818
    """The other side did not move for as long as one has patience."""


class _Over(Exception):  # noqa: N818
    """Ends a thread when the other side has ended with an error."""


class _Channel(Generic[T]):
    """A bounded queue that either side can give up."""

    def __init__(self, depth: int) -> None:
        self._queue: queue.Queue[T | _End] = queue.Queue(depth)
        self._given_up = threading.Event()

    def put(self, item: T | _End, patience: float | None = None) -> bool:
        """Wait for room; return False if nobody will read any more."""
        waited = 0.0
        while not self._given_up.is_set():
            with contextlib.suppress(queue.Full):
                self._queue.put(item, timeout=_TICK)
                return True
            waited += _TICK
            if patience is not None and waited >= patience:
                raise Stalled
        return False

    def take(self, patience: float | None = None) -> Iterator[T]:
        while not isinstance(item := self._next(patience), _End):
            yield item
        if item.error is not None:
            raise item.error

    def give_up(self) -> None:
        self._given_up.set()

    def _next(self, patience: float | None) -> T | _End:
        try:
            item = self._queue.get(timeout=patience)
        except queue.Empty:
            raise Stalled from None
        return _End(_Over()) if self._given_up.is_set() else item


@contextlib.contextmanager
def prefetch(
    items: Iterable[T], depth: int = 4, *, patience: float | None = None
) -> Iterator[Iterator[T]]:
    """Go through `items` in a thread; at most `depth` wait for the reader, and one for room.

    A generator is also closed in that thread. `Stalled` is raised where the next item does not come
    within `patience` seconds.
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
        yield channel.take(patience)
    finally:
        channel.give_up()
        thread.join(_MOMENT)


def run_in_thread(call: Callable[[], T], *, patience: float | None = None) -> T:
    """Return what `call` gives; it runs in a thread, so that even if it hangs Ctrl-C is heard.

    `Stalled` is raised where it does not end within `patience` seconds.
    """
    with prefetch((call() for _ in range(1)), patience=patience) as results:
        return next(results)


@contextlib.contextmanager
def write_async(
    take: Callable[[T], object],
    depth: int = 4,
    *,
    within: AbstractContextManager[object] | None = None,
    patience: float | None = None,
) -> Iterator[Callable[[T], None]]:
    """Give a function that hands items to `take` in a thread, at most `depth` of them waiting.

    The thread enters and leaves the context manager `within`, with an error if the block ends with
    one. An error of either is raised by the next call, or when the block ends; `Stalled` by a
    call for which there is no room within `patience` seconds.
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
            channel.give_up()

    def hand_over(item: T) -> None:
        if not channel.put(item, patience):
            raise failures[0]

    thread = threading.Thread(target=drain, name="vdet-write", daemon=True)
    thread.start()
    try:
        yield hand_over
        channel.put(_End())
        thread.join()
    except BaseException:
        with contextlib.suppress(Stalled):
            channel.put(_End(_Over()), _MOMENT)
        thread.join(_MOMENT)
        channel.give_up()
        raise
    if failures:
        raise failures[0]


def _closing(items: Iterable[object]) -> AbstractContextManager[object]:
    return contextlib.closing(items) if isinstance(items, Generator) else nullcontext()


@contextlib.contextmanager
def map_ordered(
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
def single_threaded_libraries() -> Iterator[None]:
    """Keep OpenCV and BLAS to one thread a call: the parallel work is by frames."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        cv2.setNumThreads(threads)
