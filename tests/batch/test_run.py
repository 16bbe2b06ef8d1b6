"""Every item once, whatever happens to the processes; here the processes are made up."""

from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass, field
from typing import TypeVar

import pytest

from vdet.batch.run import each_once

T = TypeVar("T")
R = TypeVar("R")


@dataclass
class Pool:
    """Does `count` items at a time; one of `deadly` kills all that are being done with it."""

    count: int
    deadly: Sequence[int] = ()
    kills_left: int = 1000
    rounds: list[list[int]] = field(default_factory=list)

    def map(self, function: Callable[[T], R], items: Iterable[T]) -> Generator[R]:
        self.rounds.append([])
        running: list[R] = []
        for item in items:
            running.append(function(item))
            value = running[-1]
            assert isinstance(value, tuple | int)
            number = value[1] if isinstance(value, tuple) else value
            self.rounds[-1].append(number)
            if number in self.deadly and self.kills_left:
                self.kills_left -= 1
                raise BrokenExecutor
            if len(running) == self.count:
                yield running.pop(0)
        yield from running


def same(item: int) -> int:
    return item


def test_every_item_is_done_once_and_paired_with_its_result() -> None:
    pool = Pool(3)
    assert list(each_once(same, [5, 6, 7, 5], pool)) == [(5, 5), (6, 6), (7, 7), (5, 5)]
    assert pool.rounds == [[5, 6, 7, 5]]


def test_nothing_to_do() -> None:
    assert list(each_once(same, [], Pool(2))) == []


@pytest.mark.parametrize("count", [1, 2, 4])
def test_the_one_that_kills_is_told_from_those_beside_it(count: int) -> None:
    items = list(range(10))
    results = dict(each_once(same, items, Pool(count, deadly=[3, 7])))
    assert results == {item: None if item in (3, 7) else item for item in items}


def test_what_was_killed_by_chance_is_done_again_alone() -> None:
    pool = Pool(2, deadly=[3], kills_left=1)
    results = dict(each_once(same, range(6), pool))
    assert results == {item: item for item in range(6)}
    assert pool.rounds == [[0, 1, 2, 3], [4, 5], [2], [3]]


def test_processes_that_cannot_even_begin_end_the_batch() -> None:
    results = dict(each_once(same, range(4), Pool(2, deadly=range(4))))
    assert results == dict.fromkeys(range(4))


def test_another_error_is_raised() -> None:
    def fail(_: int) -> int:
        raise ValueError("a bug")

    with pytest.raises(ValueError, match="a bug"):
        list(each_once(fail, [1], Pool(1)))
