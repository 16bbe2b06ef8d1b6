"""Threads that read, search and write in parallel: items keep their order, one error ends all.

Each is a context manager. When its block ends, its threads have ended, with one exception:
a thread that hangs in a read or write (for example on a network disk that is gone) is abandoned
after `JOIN_TIMEOUT`, with the files that only it has open.
"""

import sys
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import Any, TypeVar

T = TypeVar("T")
R = TypeVar("R")
S = TypeVar("S")

JOIN_TIMEOUT = 2.0  # seconds for a thread to end
DEPTH = 2  # items queued between two threads
_END = object()  # follows the last item


class SearchThreads(ThreadPoolExecutor):
    """Threads for the search; at the end of the block, calls that have not begun are cancelled."""

    def __init__(self, count: int, name: str = "vdet-search") -> None:
        super().__init__(count, thread_name_prefix=name)
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


class _Thread(SearchThreads):
    """A thread that makes calls in turn.

    At the end of the block, pending calls are still made, but waited for only `JOIN_TIMEOUT`.
    """

    def __init__(self, name: str) -> None:
        super().__init__(1, name)

    def __exit__(self, *_: object) -> None:
        with suppress(RuntimeError):  # the interpreter exits, and its threads have ended
            hangs = wait([self.submit(int)], JOIN_TIMEOUT).not_done
            self.shutdown(wait=not hangs)


@contextmanager
def read_async(source: AbstractContextManager[S]) -> Iterator[tuple[S, Iterator[Any]]]:
    """Yield the value of a context manager, and an iterator over that value.

    A thread enters the context manager, iterates at most `DEPTH` items ahead of the consumer, and
    exits.
    """
    ahead: deque[Future[Any]] = deque()
    with _Thread("vdet-read") as thread:
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
            with suppress(RuntimeError):  # the interpreter exits
                thread.submit(source.__exit__, None, None, None)


@contextmanager
def write_async(
    take: Callable[[T], object], *, within: AbstractContextManager[object]
) -> Iterator[Callable[[T], None]]:
    """Yield a function that passes items to `take` in a thread; at most `DEPTH` items wait.

    The thread enters and exits the context manager `within`, with the error of the block if there
    is one. An error in the thread is raised by a later call, or when the block ends.
    """
    with _Thread("vdet-write") as thread:
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
