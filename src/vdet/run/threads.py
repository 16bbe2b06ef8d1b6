"""Threads that read, search and write ahead: items keep their order, an error in one ends all.

Each part is a context manager. When its block ends, its threads have ended. There is one exception:
a thread that hangs in a read or write (for instance on a network disk that is gone) is abandoned
after `JOIN_TIMEOUT`, together with the files that only it has open.
"""

import queue
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from contextvars import copy_context
from functools import partial
from typing import Any, Self, TypeVar

T = TypeVar("T")
R = TypeVar("R")

JOIN_TIMEOUT = 2.0  # seconds that a thread gets to end
DEPTH = 2  # items between two threads
_END = object()  # what follows the last item
_AHEAD = 8
"""Largest number of items that `map_ordered` takes ahead for each thread."""


class StalledError(Exception):
    """A read or a write did not end in time."""


class _Thread(threading.Thread):
    """A thread that makes calls in turn; unlike a pool, it does not keep the program from ending.

    It is a context manager. At the end of the block, all calls are still made.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._calls: queue.SimpleQueue[tuple[Future[Any], partial[Any]] | None]
        self._calls = queue.SimpleQueue()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._calls.put(None)
        self.join(JOIN_TIMEOUT)

    def submit(self, call: Callable[..., R], *arguments: Any) -> Future[R]:
        future: Future[R] = Future()
        self._calls.put((future, partial(copy_context().run, call, *arguments)))
        return future

    def run(self) -> None:
        while entry := self._calls.get():
            future, call = entry
            if future.set_running_or_notify_cancel():
                try:
                    future.set_result(call())
                except BaseException as error:
                    future.set_exception(error)
            del entry, future, call  # otherwise they hold an item until the next one comes


def _result(future: Future[R], timeout: float | None) -> R:
    """Wait for a result; raise `StalledError` if it does not come within `timeout` seconds."""
    try:
        return future.result(timeout)
    except TimeoutError:
        if future.done():  # then it is an error of the call itself
            raise
        raise StalledError from None


@contextmanager
def prefetch(items: Iterable[T], *, timeout: float | None = None) -> Iterator[Iterator[T]]:
    """Take `items` in a thread, at most `DEPTH` ahead of the reader.

    A generator is closed in that thread too. If the next item does not come within `timeout`
    seconds, `StalledError` is raised.
    """
    iterator = iter(items)
    ahead: deque[Future[Any]] = deque()
    take_one = partial(next, iterator, _END)

    with _Thread("vdet-prefetch") as thread:
        ahead.extend(thread.submit(take_one) for _ in range(DEPTH))

        def taken() -> Iterator[T]:
            while (item := _result(ahead.popleft(), timeout)) is not _END:
                ahead.append(thread.submit(take_one))
                yield item

        try:
            yield taken()
        finally:
            for future in ahead:
                future.cancel()
            if isinstance(iterator, Generator):
                thread.submit(iterator.close)


@contextmanager
def write_async(
    take: Callable[[T], object],
    *,
    within: AbstractContextManager[object],
    timeout: float | None = None,
    extra: Callable[[], float] = lambda: 0.0,
) -> Iterator[Callable[[T], None]]:
    """Give a function that passes items to `take` in a thread; at most `DEPTH` items wait.

    The thread enters and leaves the context manager `within`, with an error if the block ends with
    one. An error in the thread is raised by a later call, or when the block ends. A call raises
    `StalledError` if there is no room within `timeout` seconds. So does the end of the block if the
    last items, or leaving `within`, get no further within `timeout` and the `extra` seconds.
    """
    waiting: deque[Future[object]] = deque()

    with _Thread("vdet-write") as thread:

        def wait(most: int, limit: float | None) -> None:
            """Wait until at most `most` calls are not done."""
            while waiting and (len(waiting) > most or waiting[0].done()):
                _result(waiting.popleft(), limit)

        def put(item: T) -> None:
            wait(DEPTH - 1, timeout)
            waiting.append(thread.submit(take, item))

        waiting.append(thread.submit(within.__enter__))
        try:
            yield put
            limit = None if timeout is None else timeout + extra()
            wait(0, limit)
        except BaseException:
            thread.submit(within.__exit__, *sys.exc_info())
            raise
        _result(thread.submit(within.__exit__, None, None, None), limit)


@contextmanager
def map_ordered(
    function: Callable[[T], R],
    items: Iterable[T],
    threads: int,
    *,
    is_work: Callable[[T], bool] = lambda _: True,
) -> Iterator[Iterator[tuple[T, R]]]:
    """Pair items with the results of `function`, computed in parallel, in their order.

    Items are taken until there is one for each thread and one more. Those for which `is_work` is
    false get None and do not count, but at most `_AHEAD` items are taken for each thread.
    """
    running: deque[tuple[T, Future[R] | None]] = deque()

    with ThreadPoolExecutor(threads, thread_name_prefix="vdet-search") as pool:

        def pairs() -> Iterator[tuple[T, Any]]:
            work = 0
            for item in items:
                call = partial(copy_context().run, function, item)
                running.append((item, pool.submit(call) if is_work(item) else None))
                work += running[-1][1] is not None
                while work > threads or len(running) > _AHEAD * threads:
                    first, future = running.popleft()
                    work -= future is not None
                    yield first, future and future.result()
            while running:
                first, future = running.popleft()
                yield first, future and future.result()

        try:
            yield pairs()
        finally:
            pool.shutdown(cancel_futures=True)
