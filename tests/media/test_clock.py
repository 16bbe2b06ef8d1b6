"""Times strictly increase, and are the file's own wherever those do."""

from fractions import Fraction
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from vdet.media.clock import Clock

TICK = Fraction(1, 1000)
PERIOD = Fraction(1, 25)


def times(*stamps: int | None) -> list[Fraction]:
    clock = Clock(TICK, PERIOD)
    return [clock.time(stamp) for stamp in stamps]


def test_stamps_that_increase_are_taken_exactly() -> None:
    assert times(-7, 0, 3, 1000) == [-7 * TICK, 0, 3 * TICK, 1]


def test_a_missing_stamp_is_one_period_after_the_frame_before() -> None:
    assert times(None, None, 200, None) == [0, PERIOD, Fraction(1, 5), Fraction(6, 25)]


def test_a_stamp_that_repeats_or_goes_back_counts_as_missing() -> None:
    assert times(100, 100, 20, 500) == [
        Fraction(1, 10),
        Fraction(7, 50),
        Fraction(9, 50),
        Fraction(1, 2),
    ]


@given(st.lists(st.none() | st.integers(-(2**40), 2**40)))
def test_times_always_increase(stamps: list[int | None]) -> None:
    assert all(earlier < later for earlier, later in pairwise(times(*stamps)))


@given(st.sets(st.integers(-(2**40), 2**40)))
def test_increasing_stamps_are_never_touched(stamps: set[int]) -> None:
    increasing = sorted(stamps)
    assert times(*increasing) == [stamp * TICK for stamp in increasing]
