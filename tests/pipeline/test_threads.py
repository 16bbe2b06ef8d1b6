"""Threads that keep order and end with their block, whatever happens in it."""

import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import islice

import cv2
import pytest
from threadpoolctl import threadpool_info

from vdet.pipeline.threads import (
    StalledError,
    map_ordered,
    prefetch,
    run_in_thread,
    single_threaded_libraries,
    write_async,
)

PLACES = ("source", "function", "taker")
Errors = pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt, SystemExit])


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Iterator[None]:
    yield
    assert [thread.name for thread in threading.enumerate() if "vdet-" in thread.name] == []


@pytest.fixture
def ctrl_c() -> Iterator[Callable[[], None]]:
    """Interrupt the main thread as the keyboard does, from any thread."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    main = threading.main_thread().ident
    assert main is not None
    yield lambda: signal.pthread_kill(main, signal.SIGINT)
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def hang(no_thread_is_left: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """What a thread can wait for as if for ever: the end of the test."""
    assert no_thread_is_left is None
    monkeypatch.setattr("vdet.pipeline.threads.JOIN_TIMEOUT", 0.1)
    event = threading.Event()
    yield event
    event.set()
    until(lambda: not any("vdet-" in thread.name for thread in threading.enumerate()))


def until(condition: Callable[[], bool]) -> None:
    """Wait for another thread, five seconds at most."""
    for _ in range(500):
        if condition():
            return
        time.sleep(0.01)
    pytest.fail("it never came to that")


def settled(values: list[int]) -> list[int]:
    """Wait until another thread has added nothing for a while."""
    size = -1
    while size != len(values):
        size = len(values)
        time.sleep(0.05)
    return values


def failing(error: BaseException, after: int) -> Iterator[int]:
    yield from range(after)
    raise error


def fail(error: BaseException, after: object) -> None:
    assert after is not None
    raise error


def hand_all(items: Iterable[int], hand_over: Callable[[int], None]) -> None:
    for item in items:
        hand_over(item)


def noting(items: Iterable[int], seen: list[int]) -> Iterator[int]:
    for item in items:
        seen.append(item)
        yield item


class TestAhead:
    @pytest.mark.parametrize("depth", [1, 4, 100])
    def test_gives_all_items_in_order(self, depth: int) -> None:
        with prefetch(range(50), depth) as items:
            assert list(items) == list(range(50))

    def test_gives_nothing_where_there_is_nothing(self) -> None:
        with prefetch(range(0)) as items:
            assert list(items) == []

    def test_works_before_it_is_asked(self) -> None:
        made: list[int] = []
        with prefetch(noting(range(3), made)):
            until(lambda: made == [0, 1, 2])

    @pytest.mark.parametrize("depth", [1, 3])
    def test_lets_so_many_wait_and_holds_one_more(self, depth: int) -> None:
        made: list[int] = []
        with prefetch(noting(range(50), made), depth) as items:
            for taken in range(4):
                assert len(settled(made)) - taken == depth + 1
                next(items)

    @Errors
    def test_an_error_of_the_source_comes_after_what_it_gave(
        self, kind: type[BaseException]
    ) -> None:
        error = kind("source")
        read: list[int] = []
        with pytest.raises(kind) as caught, prefetch(failing(error, after=7)) as items:
            read.extend(items)
        assert caught.value is error
        assert read == list(range(7))

    @Errors
    def test_an_error_of_the_reader_ends_the_source(self, kind: type[BaseException]) -> None:
        error = kind("reader")
        made: list[int] = []
        with pytest.raises(kind) as caught, prefetch(noting(range(10**9), made), 2) as items:
            fail(error, after=next(items))
        assert caught.value is error
        assert len(made) <= 1 + 2 + 1

    def test_the_reader_may_stop_early(self) -> None:
        with prefetch(iter(int, 1)) as items:
            assert next(items) == 0

    @pytest.mark.parametrize("take", [1, 3])
    def test_a_generator_is_closed_by_the_thread_that_ran_it(self, take: int) -> None:
        threads: list[threading.Thread] = []

        def items() -> Iterator[int]:
            threads.append(threading.current_thread())
            try:
                yield from range(3)
            finally:
                threads.append(threading.current_thread())

        with prefetch(items()) as read:
            assert list(islice(read, take)) == list(range(take))
        opened, closed = threads
        assert opened is closed is not threading.current_thread()

    def test_a_source_that_hangs_is_given_up_and_left_alone(self, hang: threading.Event) -> None:
        def items() -> Iterator[int]:
            yield 1
            hang.wait()

        read: list[int] = []
        with pytest.raises(StalledError), prefetch(items(), timeout=0.2) as given:
            read.extend(given)
        assert read == [1]

    def test_ctrl_c_ends_the_wait_for_a_source_that_hangs(
        self, hang: threading.Event, ctrl_c: Callable[[], None]
    ) -> None:
        def items() -> Iterator[int]:
            ctrl_c()
            hang.wait()
            yield 1

        with pytest.raises(KeyboardInterrupt), prefetch(items()) as given:
            next(given)


class TestAside:
    def test_gives_what_the_call_gives(self) -> None:
        assert run_in_thread(lambda: threading.current_thread().name) == "vdet-prefetch"

    def test_raises_what_the_call_raises(self) -> None:
        error = ValueError("call")
        with pytest.raises(ValueError, match="call") as caught:
            run_in_thread(lambda: fail(error, after=1))
        assert caught.value is error

    def test_a_call_that_hangs_is_given_up(self, hang: threading.Event) -> None:
        with pytest.raises(StalledError):
            run_in_thread(hang.wait, timeout=0.1)


class TestBehind:
    @pytest.mark.parametrize("depth", [1, 4, 100])
    def test_hands_all_items_over_in_order(self, depth: int) -> None:
        taken: list[int] = []
        with write_async(taken.append, depth) as hand_over:
            hand_all(range(50), hand_over)
        assert taken == list(range(50))

    def test_nothing_may_be_handed_over(self) -> None:
        taken: list[int] = []
        with write_async(taken.append):
            pass
        assert taken == []

    def test_lets_so_many_wait_beside_the_one_that_is_taken(self) -> None:
        gate = threading.Event()
        handed: list[int] = []

        def give_all() -> None:
            for item in range(10):
                hand_over(item)
                handed.append(item)

        with write_async(lambda _: gate.wait(5), depth=3) as hand_over:
            giver = threading.Thread(target=give_all)
            giver.start()
            try:
                assert len(settled(handed)) == 3 + 1
            finally:
                gate.set()
                giver.join()
        assert len(handed) == 10

    @Errors
    def test_an_error_of_the_taker_is_raised_at_one_of_the_next_items(
        self, kind: type[BaseException]
    ) -> None:
        error = kind("taker")
        taken: list[int] = []

        def take(item: int) -> None:
            if item == 3:
                raise error
            taken.append(item)

        with pytest.raises(kind) as caught, write_async(take, 2) as hand_over:
            hand_all(range(10**9), hand_over)
        assert caught.value is error
        assert taken == [0, 1, 2]

    def test_an_error_at_the_last_item_is_raised_when_the_block_ends(self) -> None:
        error = ValueError("taker")

        def take(_: int) -> None:
            raise error

        with pytest.raises(ValueError, match="taker") as caught, write_async(take) as hand_over:
            hand_over(0)
        assert caught.value is error

    def test_the_thread_enters_and_leaves_the_context(self) -> None:
        seen: list[object] = []

        @contextmanager
        def within() -> Iterator[None]:
            seen.append(threading.current_thread().name)
            yield
            seen.append("left")

        with write_async(seen.append, within=within()) as hand_over:
            hand_over(1)
        assert seen == ["vdet-write", 1, "left"]

    @Errors
    def test_an_error_of_the_giver_is_one_in_the_context_too(
        self, kind: type[BaseException]
    ) -> None:
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
        with (
            pytest.raises(kind) as caught,
            write_async(taken.append, within=within()) as hand_over,
        ):
            hand_all(failing(error, after=2), hand_over)
        assert caught.value is error
        assert taken == [0, 1]
        assert len(seen) == 1

    @pytest.mark.parametrize("place", ["enter", "exit"])
    def test_an_error_of_the_context_is_raised(self, place: str) -> None:
        @contextmanager
        def within() -> Iterator[None]:
            fail(ValueError(place), after=1) if place == "enter" else None
            yield
            raise ValueError(place)

        with pytest.raises(ValueError, match=place), write_async(int, within=within()) as hand_over:
            hand_over(0)

    def test_a_taker_that_hangs_is_given_up_and_left_alone(self, hang: threading.Event) -> None:
        left: list[str] = []

        @contextmanager
        def within() -> Iterator[None]:
            try:
                yield
            except BaseException as error:
                left.append(type(error).__name__)
                raise

        with (
            pytest.raises(StalledError),
            write_async(lambda _: hang.wait(), 1, within=within(), timeout=0.2) as hand_over,
        ):
            hand_all(range(10), hand_over)
        assert left == [], "the thread hangs: what it has open is not touched"
        hang.set()
        until(lambda: left == ["_ClosedError"])

    @Errors
    def test_after_an_error_of_the_giver_what_was_given_is_still_taken(
        self, kind: type[BaseException]
    ) -> None:
        error = kind("giver")
        taken: list[int] = []
        with pytest.raises(kind) as caught, write_async(taken.append) as hand_over:
            hand_all(failing(error, after=2), hand_over)
        assert caught.value is error
        assert taken == [0, 1]


class TestEachWith:
    @pytest.mark.parametrize("threads", [1, 2, 5])
    def test_pairs_come_in_order_whichever_is_done_first(self, threads: int) -> None:
        def slow_at_first(item: int) -> int:
            time.sleep(0.003 * (10 - item))
            return item**2

        with map_ordered(slow_at_first, range(10), threads) as pairs:
            assert list(pairs) == [(item, item**2) for item in range(10)]

    def test_nothing_gives_no_pairs(self) -> None:
        with map_ordered(str, range(0), 2) as pairs:
            assert list(pairs) == []

    def test_so_many_threads_work_at_once(self) -> None:
        together = threading.Barrier(3, timeout=5)
        with map_ordered(lambda _: together.wait(), range(3), threads=3) as pairs:
            assert sorted(turn for _, turn in pairs) == [0, 1, 2]

    @pytest.mark.parametrize("threads", [1, 3])
    def test_no_more_items_are_taken_than_threads_and_one(self, threads: int) -> None:
        taken: list[int] = []
        with map_ordered(str, noting(range(50), taken), threads) as pairs:
            for received, _ in enumerate(pairs, start=1):
                assert len(taken) - received <= threads

    @Errors
    @pytest.mark.parametrize("threads", [1, 3])
    def test_an_error_of_the_function_comes_in_the_place_of_its_pair(
        self, kind: type[BaseException], threads: int
    ) -> None:
        error = kind("function")
        received: list[int] = []

        def fail_at_5(item: int) -> int:
            if item == 5:
                raise error
            return item

        with pytest.raises(kind) as caught, map_ordered(fail_at_5, range(50), threads) as pairs:
            received.extend(item for item, _ in pairs)
        assert caught.value is error
        assert received == list(range(5))

    @Errors
    def test_an_error_of_the_items_is_raised_unchanged(self, kind: type[BaseException]) -> None:
        error = kind("items")
        with (
            pytest.raises(kind) as caught,
            map_ordered(str, failing(error, after=3), threads=2) as pairs,
        ):
            list(pairs)
        assert caught.value is error

    @Errors
    def test_after_an_error_of_the_reader_nothing_more_is_begun(
        self, kind: type[BaseException]
    ) -> None:
        error = kind("reader")
        begun: list[int] = []

        def begin(item: int) -> None:
            begun.append(item)

        with (
            pytest.raises(kind) as caught,
            map_ordered(begin, range(10**9), threads=2) as pairs,
        ):
            fail(error, after=next(pairs))
        assert caught.value is error
        assert len(begun) <= 3


class TestTogether:
    """The three as the pipeline has them: reading, searching and writing overlap."""

    @staticmethod
    def run(
        source: Iterable[int], function: Callable[[int], int], take: Callable[[int], object]
    ) -> None:
        with ExitStack() as stack:
            hand_over = stack.enter_context(write_async(take))
            items = stack.enter_context(prefetch(source))
            for _, result in stack.enter_context(map_ordered(function, items, threads=2)):
                hand_over(result)

    def test_everything_arrives_in_order(self) -> None:
        taken: list[int] = []
        self.run(range(100), lambda item: -item, taken.append)
        assert taken == [-item for item in range(100)]

    @Errors
    @pytest.mark.parametrize("place", PLACES)
    def test_an_error_anywhere_ends_everything(self, kind: type[BaseException], place: str) -> None:
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
                map(stages["source"], noting(range(10**9), made)),
                stages["function"],
                stages["taker"],
            )
        assert caught.value is error
        assert len(made) < 60

    def test_ctrl_c_in_the_middle_ends_everything(self, ctrl_c: Callable[[], None]) -> None:
        def press_at_20(item: int) -> int:
            if item == 20:
                ctrl_c()
            return item

        made: list[int] = []
        with pytest.raises(KeyboardInterrupt):
            self.run(noting(range(10**9), made), press_at_20, lambda _: time.sleep(0.001))
        assert len(made) < 1000


class TestQuietLibraries:
    @pytest.fixture(autouse=True)
    def two_threads(self) -> Iterator[None]:
        before = cv2.getNumThreads()
        cv2.setNumThreads(2)
        yield
        cv2.setNumThreads(before)

    def test_inside_they_have_one_thread_and_afterwards_as_many_as_before(self) -> None:
        before = [pool["num_threads"] for pool in threadpool_info()]
        with single_threaded_libraries():
            assert cv2.getNumThreads() == 1
            assert {pool["num_threads"] for pool in threadpool_info()} == {1}
        assert cv2.getNumThreads() == 2
        assert [pool["num_threads"] for pool in threadpool_info()] == before

    @Errors
    def test_an_error_restores_them_too(self, kind: type[BaseException]) -> None:
        with pytest.raises(kind), single_threaded_libraries():
            raise kind
        assert cv2.getNumThreads() == 2
