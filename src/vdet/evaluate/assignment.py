"""The best pairing of rows with columns."""

from typing import Any

import numpy as np
import numpy.typing as npt

from vdet.evaluate.labelled_video import Integers
from vdet.geometry import Float64Array


def assign(scores: npt.NDArray[Any]) -> tuple[Integers, Integers]:
    """Pair rows with columns, each at most once, so that the sum of the scores is largest.

    Parameters
    ----------
    scores
        Shape `(n, m)`.

    Returns
    -------
    Rows and columns of the pairs whose score is above 0, rows ascending.
    """
    from scipy.optimize import linear_sum_assignment  # type: ignore[import-untyped]

    rows, columns = linear_sum_assignment(scores, maximize=True)
    paired = scores[rows, columns] > np.finfo(np.float64).eps
    return rows[paired], columns[paired]


def at_least(overlaps: Float64Array, threshold: float) -> npt.NDArray[np.bool_]:
    """Tell where `overlaps` reaches `threshold`, give or take the last bit of a float64."""
    return np.asarray(overlaps >= threshold - np.finfo(np.float64).eps)
