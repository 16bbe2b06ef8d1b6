"""How well boxes fit, and pairs with the largest sum: against SciPy, and in rounds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.optimize import linear_sum_assignment

from vdet.boxes import Float64Array
from vdet.track.motion.tracker import assign, buffered_iou, pair

EXPECTED = np.array([[100.0, 100, 200, 160], [400, 100, 450, 150]])
BESIDE = np.array([[210.0, 100, 310, 160]])


@pytest.mark.parametrize(("buffer", "fit"), [((0.05, 0.05), 0), ((0.5, 0.1), 40 / 260)])
def test_boxes_that_do_not_touch_fit_where_the_motion_is_unknown(
    buffer: tuple[float, float], fit: float
) -> None:
    values = buffered_iou(EXPECTED, np.array([buffer, buffer]), BESIDE)
    assert values == pytest.approx(np.array([[fit], [0]]))


def test_a_later_round_has_what_the_earlier_ones_left() -> None:
    assert pair(np.array([[0.9, 0.4], [0.3, 0.0]]), [[1], [0]]) == {1: 0, 0: 1}


SHAPES = array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=9)
TENTHS = st.integers(0, 10).map(lambda tenths: tenths / 10)
"""So that many values are equal, and many are 0."""


@given(arrays(np.float64, SHAPES, elements=TENTHS | st.floats(0, 1)))
def test_no_other_pairs_have_a_larger_sum(values: Float64Array) -> None:
    rows, columns = linear_sum_assignment(values, maximize=True)
    assert np.isclose(values[assign(values)].sum(), values[rows, columns].sum())
