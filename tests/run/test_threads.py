"""Threads keep the order of items, and end with their block, also after an error in it."""

import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import ExitStack, closing, contextmanager, nullcontext
from itertools import islice

import pytest

from running import SOON
from vdet.workers import SearchThreads, read_async, write_async

PLACES = ("source", "function", "taker")
Errors = pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt, SystemExit])


@pytest.fixture(autouse=True)
def no_thread_is_left(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr("vdet.workers.JOIN_TIMEOUT", SOON)
    yield
    assert threads_of_vdet() == []


def threads_of_vdet() -> list[str]:
    return [thread.name for thread in threading.enumerate() if "vdet-" in thread.name]


def failing(error: BaseException, after: int) -> Iterator[int]:
    yield from range(after)
    raise error


def hand_all(items: Iterable[int], hand_over: Callable[[int], None]) -> None:
    for item in items:
        hand_over(item)


def recording(items: Iterable[int], seen: list[int]) -> Iterator[int]:
    for item in items:
        seen.append(item)
        yield item


class TestReading:
    @pytest.mark.parametrize("take", [1, 3])
    def test_a_generator_is_closed_by_the_thread_that_ran_it(self, take: int) -> None:
        threads: list[threading.Thread] = []

        def items() -> Generator[int]:
            threads.append(threading.current_thread())
            try:
                yield from range(3)
            finally:
                threads.append(threading.current_thread())

        with read_async(closing(items())) as (_, read):
            assert list(islice(read, take)) == list(range(take))
        opened, closed = threads
        assert opened is closed is not threading.current_thread()


@Errors
def test_an_error_of_the_giver_is_an_error_in_the_context_too(kind: type[BaseException]) -> None:
    error = kind("giver")
    seen: list[BaseException] = []

    @contextmanager
    def within() -> Iterator[None]:
        try:
            yield
        except BaseException as inside:
            seen.append(inside)
            raise

    taken: list[int] = []
    with pytest.raises(kind) as caught, write_async(taken.append, within=within()) as hand_over:
        hand_all(failing(error, after=2), hand_over)
    assert caught.value is error
    assert taken == [0, 1]
    assert len(seen) == 1


class TestMapOrdered:
    @pytest.mark.parametrize("threads", [1, 2, 5])
    def test_pairs_come_in_order_although_later_ones_end_first(self, threads: int) -> None:
        ended = [threading.Event() for _ in range(10)]

        def odd_ones_end_first(item: int) -> int:
            if threads > 1 and item % 2 == 0:
                assert ended[item + 1].wait(SOON)
            ended[item].set()
            return item**2

        with SearchThreads(threads) as pool:
            pairs = list(pool.map_ordered(odd_ones_end_first, range(10)))
            assert pairs == [(item, item**2) for item in range(10)]


class TestAllTogether:
    """As in the pipeline: reading, searching and writing overlap."""

    @staticmethod
    def run(
        source: Iterable[int], function: Callable[[int], int], take: Callable[[int], object]
    ) -> None:
        with ExitStack() as stack:
            hand_over = stack.enter_context(write_async(take, within=nullcontext()))
            _, items = stack.enter_context(read_async(nullcontext(source)))
            pool = stack.enter_context(SearchThreads(2))
            for _, result in pool.map_ordered(function, items):
                hand_over(result)

    @Errors
    @pytest.mark.parametrize("place", PLACES)
    def test_any_error_ends_all_threads(self, kind: type[BaseException], place: str) -> None:
        error = kind(place)
        made: list[int] = []

        def fail_at_20(item: int) -> int:
            if item == 20:
                raise error
            return item

        stages: dict[str, Callable[[int], int]] = dict.fromkeys(
            ("source", "function", "taker"), int
        )
        stages[place] = fail_at_20
        with pytest.raises(kind) as caught:
            self.run(
                map(stages["source"], recording(range(10**9), made)),
                stages["function"],
                stages["taker"],
            )
        assert caught.value is error
        assert len(made) < 60
