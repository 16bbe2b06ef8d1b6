import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.learn.splits import hold_out

GROUPS = np.array(["a"] * 10 + ["b"] * 5 + ["c"] * 3 + ["d"])


def test_the_tail_split_holds_out_the_last_of_each_group() -> None:
    held = hold_out(GROUPS, "tail", 0.2, seed=0)
    assert np.flatnonzero(held).tolist() == [8, 9, 14, 17]


def test_the_tail_split_does_not_need_the_groups_in_one_piece() -> None:
    held = hold_out(np.array(["a", "b"] * 5), "tail", 0.4, seed=0)
    assert np.flatnonzero(held).tolist() == [6, 7, 8, 9]


def test_the_only_patch_of_a_group_is_learnt_from() -> None:
    assert not hold_out(np.array(["a", "b", "c"]), "tail", 0.2, seed=0).any()


def test_the_tail_split_does_not_depend_on_the_seed() -> None:
    one, other = (hold_out(GROUPS, "tail", 0.2, seed) for seed in (0, 1))
    np.testing.assert_array_equal(one, other)


def test_the_random_split_depends_on_the_seed_alone() -> None:
    groups = np.array(["a"] * 100)
    one, same, other = (hold_out(groups, "random", 0.2, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()


def test_the_random_split_pays_no_heed_to_groups() -> None:
    np.testing.assert_array_equal(
        hold_out(GROUPS, "random", 0.3, seed=0), hold_out(GROUPS[::-1], "random", 0.3, seed=0)
    )


def test_the_random_split_is_not_the_tail() -> None:
    held = hold_out(np.array(["a"] * 100), "random", 0.2, seed=0)
    assert held[:80].any()


@given(st.integers(2, 500), st.floats(0.01, 0.99), st.integers(0, 10))
def test_the_random_split_holds_out_the_fraction_but_never_nothing_or_all(
    count: int, fraction: float, seed: int
) -> None:
    held = hold_out(np.array(["a"] * count), "random", fraction, seed)
    assert 1 <= held.sum() <= count - 1
    assert abs(held.sum() - count * fraction) <= 1


@pytest.mark.parametrize("fraction", [0.01, 0.5, 0.99])
def test_the_tail_split_holds_out_some_of_each_group_of_two_or_more(fraction: float) -> None:
    held = hold_out(GROUPS, "tail", fraction, seed=0)
    for group in "abc":
        rows = [i for i, name in enumerate(GROUPS) if name == group]
        assert 1 <= held[rows].sum() < len(rows)
