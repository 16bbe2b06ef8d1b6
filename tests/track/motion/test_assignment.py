"""Pairs with the largest sum: against SciPy, and where several are as good."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.optimize import linear_sum_assignment  # type: ignore[import-untyped]

from vdet.boxes import Float64Array
from vdet.track.motion.assignment import assign

SHAPES = array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=9)
TENTHS = st.integers(0, 10).map(lambda tenths: tenths / 10)
"""So that many values are equal, and many are 0."""


def sum_of(values: Float64Array, pairs: list[tuple[int, int]]) -> float:
    return float(sum(values[row, column] for row, column in pairs))


@given(arrays(np.float64, SHAPES, elements=TENTHS | st.floats(0, 1)))
def test_no_other_pairs_have_a_larger_sum(values: Float64Array) -> None:
    rows, columns = linear_sum_assignment(values, maximize=True)
    assert np.isclose(sum_of(values, assign(values)), values[rows, columns].sum())


@given(arrays(np.float64, SHAPES, elements=TENTHS))
def test_each_row_and_column_is_used_once_and_none_for_nothing(values: Float64Array) -> None:
    pairs = assign(values)
    rows, columns = zip(*pairs, strict=True) if pairs else ((), ())
    assert list(rows) == sorted(set(rows))
    assert len(set(columns)) == len(columns)
    assert all(values[row, column] > 0 for row, column in pairs)
