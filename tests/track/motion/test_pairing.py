from itertools import permutations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vdet.geometry import Float64Array
from vdet.track.motion.pairing import pair


def matrix(*rows: list[float]) -> Float64Array:
    return np.array(rows, np.float64)


def test_the_pairs_add_up_to_most_even_if_one_is_not_its_best() -> None:
    assert pair(matrix([0.6, 0.5], [0.5, 0.0]), [[0, 1]]) == {0: 1, 1: 0}


def test_nothing_is_paired_at_score_0() -> None:
    assert pair(matrix([0.6, 0.0], [0.5, 0.0]), [[0, 1]]) == {0: 0}
    assert pair(matrix([0.0]), [[0]]) == {}


def test_a_later_round_has_what_the_earlier_ones_left() -> None:
    scores = matrix([0.9, 0.4], [0.3, 0.0])
    assert pair(scores, [[1], [0]]) == {1: 0, 0: 1}


def test_rows_of_no_round_are_not_paired() -> None:
    assert pair(matrix([0.9], [0.4]), [[1]]) == {1: 0}


def test_nobody_or_nothing_gives_no_pairs() -> None:
    assert pair(np.zeros((0, 3)), [[], []]) == {}
    assert pair(np.zeros((2, 0)), [[0], [1]]) == {}


def test_the_scores_are_left_as_they_are() -> None:
    scores = matrix([0.6, 0.5], [0.5, 0.0])
    pair(scores, [[0], [1]])
    assert (scores == matrix([0.6, 0.5], [0.5, 0.0])).all()


values = st.sampled_from([0.0, 0.0, 0.3, 0.45, 0.7, 1.0])


@given(arrays(np.float64, (3, 4), elements=values))
def test_no_other_pairs_add_up_to_more(scores: Float64Array) -> None:
    pairs = pair(scores, [[0, 1, 2]])
    assert len(set(pairs.values())) == len(pairs)
    best = max(scores[range(3), list(columns)].sum() for columns in permutations(range(4), 3))
    total = sum(scores[row, column] for row, column in pairs.items())
    assert np.isclose(total, best)
