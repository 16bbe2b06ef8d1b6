"""Where a vehicle's sides are, from the HOG of a window around it: linear ridge regression."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from vdet.detect.svm.features import Vectors
from vdet.detect.svm.model import BoxRegression
from vdet.learn.extraction import Flags, SidesTable

Weights = npt.NDArray[np.float32]

_LEAST_SPREAD = 0.05
"""Added to each feature's spread, share of the mean spread: what hardly varies is not blown up."""


def fit_boxes(
    hogs: Vectors, sides: SidesTable, penalty: float, weights: Weights | None = None
) -> BoxRegression:
    """Fit the sides of vehicles' boxes to HOG vectors.

    Parameters
    ----------
    hogs
        float32 of shape `(n, h)`.
    sides
        float32 of shape `(n, 4)`: left, top, right, bottom from the window's centre in its sides,
        NaN for a side that is not known. A side of which nothing is known is always 0.
    penalty
        Ridge penalty of the weights of scaled features, a patch.
    weights
        float32 of shape `(n,)`: how much each row counts; None for all alike.
    """
    if weights is None:
        weights = np.ones(len(hogs), np.float32)
    slopes = np.zeros((4, hogs.shape[1]), np.float32)
    biases = np.zeros(4, np.float32)
    for columns, rows in _patterns(~np.isnan(sides)):
        targets = sides[rows][:, columns]
        slopes[columns], biases[columns] = _ridge(hogs[rows], targets, penalty, weights[rows])
    return BoxRegression(slopes, biases)


def _patterns(known: Flags) -> Iterator[tuple[list[int], Flags]]:
    """Give the columns that are known in the same rows, and these rows: they are solved at once."""
    left = [column for column in range(known.shape[1]) if known[:, column].any()]
    while left:
        rows = known[:, left[0]]
        columns = [column for column in left if (known[:, column] == rows).all()]
        yield columns, rows
        left = [column for column in left if column not in columns]


def _ridge(
    hogs: Vectors, targets: SidesTable, penalty: float, weights: Weights
) -> tuple[Vectors, Vectors]:
    from sklearn.linear_model import Ridge

    spread = hogs.std(axis=0)
    spread += _LEAST_SPREAD * spread.mean() + np.finfo(np.float32).tiny
    alpha = penalty * float(weights.sum())
    ridge = Ridge(alpha=alpha, solver="cholesky").fit(hogs / spread, targets, weights)
    return ridge.coef_ / spread, ridge.intercept_
