import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.learn.svm.extraction import LabelledVectors, SampleVectors
from vdet.learn.svm.training_set import hold_out, training_set


def column(*values: float) -> np.ndarray:
    return np.array(values, np.float32)[:, np.newaxis]


def data(augmented: SampleVectors | None) -> LabelledVectors:
    """Return five patches whose single feature is ten times their number."""
    vehicle = np.array([True, False, True, False, True])
    sides = np.full((5, 4), np.nan, np.float32)
    sides[0] = 0.5
    groups = np.array(["a"] * 5)
    return LabelledVectors(column(0, 10, 20, 30, 40), vehicle, groups, "", 0, sides, augmented)


AUGMENTED = SampleVectors(
    column(1, 11, 12, 21, 41),
    np.array([True, False, False, False, True]),
    np.arange(20, dtype=np.float32).reshape(5, 4),
    np.array([0, 1, 1, 2, 4]),
)
KEPT = np.array([False, True, True, False, True])


def test_only_the_kept_patches_and_the_samples_made_of_them_are_used() -> None:
    samples = training_set(data(AUGMENTED), KEPT)
    assert samples.vectors[:, 0].tolist() == [10, 20, 40, 11, 12, 21, 41]
    assert samples.vehicle.tolist() == [False, True, True, False, False, False, True]
    assert samples.sides[3:, 0].tolist() == [4, 8, 12, 16]


def test_an_augmented_sample_has_the_row_of_its_patch_among_the_kept() -> None:
    samples = training_set(data(AUGMENTED), KEPT)
    assert samples.origins.tolist() == [0, 1, 2, 0, 0, 1, 2]
    np.testing.assert_array_equal(samples.vectors[samples.origins] // 10, samples.vectors // 10)


def test_without_augmentation_there_are_the_patches() -> None:
    samples = training_set(data(None), KEPT)
    assert samples.vectors[:, 0].tolist() == [10, 20, 40]
    assert samples.origins.tolist() == [0, 1, 2]


def test_without_boxes_no_side_is_known() -> None:
    bare = LabelledVectors(column(0, 1), np.array([True, False]), np.array(["a", "b"]), "", 0)
    assert np.isnan(training_set(bare, np.array([True, True])).sides).all()


GROUPS = np.array(["a"] * 10 + ["b"] * 5 + ["c"] * 3 + ["d"])


def test_the_tail_split_holds_out_the_last_of_each_group() -> None:
    held = hold_out(GROUPS, "tail", 0.2, seed=0)
    assert np.flatnonzero(held).tolist() == [8, 9, 14, 17]


def test_the_tail_split_takes_groups_that_are_scattered() -> None:
    held = hold_out(np.array(["a", "b"] * 5), "tail", 0.4, seed=0)
    assert np.flatnonzero(held).tolist() == [6, 7, 8, 9]


def test_the_only_patch_of_a_group_is_not_held_out() -> None:
    assert not hold_out(np.array(["a", "b", "c"]), "tail", 0.2, seed=0).any()


def test_the_tail_split_does_not_depend_on_the_seed() -> None:
    one, other = (hold_out(GROUPS, "tail", 0.2, seed) for seed in (0, 1))
    np.testing.assert_array_equal(one, other)


def test_the_random_split_depends_on_the_seed_alone() -> None:
    groups = np.array(["a"] * 100)
    one, same, other = (hold_out(groups, "random", 0.2, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()


def test_the_random_split_ignores_groups() -> None:
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
