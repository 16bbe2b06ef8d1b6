"""A linear SVM that is fitted in the memory of its data.

The classifier is that of scikit-learn's `LinearSVC`: squared hinge loss, L2 penalty on weights and
bias. liblinear, which `LinearSVC` calls, copies float32 data to six times their size; L-BFGS needs
only products of the data with a vector.
Source of the solver: Liu and Nocedal, "On the Limited Memory BFGS Method for Large Scale
Optimization", 1989.
"""

import warnings

import numpy as np
from scipy.optimize import minimize  # type: ignore[import-untyped]
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.exceptions import ConvergenceWarning

from vdet.boxes import BoolArray, Float32Array, Float64Array
from vdet.learn.svm.extraction import RowNumbers

_CORRECTIONS = 20  # of L-BFGS
_BLOCK = 1024  # rows whose distances are computed at a time
_TOLERANCE = 1e-9  # of the loss, relative to that of zero weights


class LinearSvm(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn has no types
    """A two-class linear SVM as a scikit-learn estimator.

    `vectors` is float32 `(n, features)`. The methods take numbers of its rows, each once,
    so that a cross-validation copies no vectors. `C` is the penalty of the errors, `max_iter` the
    most iterations of the solver. `fit` warns with `ConvergenceWarning` if they are not enough. It
    takes no sample weights.
    """

    def __init__(self, vectors: Float32Array, C: float = 1.0, max_iter: int = 1000) -> None:
        self.vectors = vectors
        self.C = C
        self.max_iter = max_iter

    def __sklearn_clone__(self) -> "LinearSvm":  # scikit-learn would copy the vectors
        return LinearSvm(self.vectors, self.C, self.max_iter)

    def fit(self, rows: RowNumbers, y: BoolArray) -> "LinearSvm":
        """Fit to some rows, with labels `y`, bool `(m,)`."""
        x = self.vectors  # all of them: a copy of some would take their memory again
        signs = np.zeros(len(x), np.float32)
        signs[rows] = np.where(y, 1, -1)
        used = abs(signs)
        scale = 1 / (self.C * len(y))  # the loss of zero weights becomes 1

        def loss(parameters: Float64Array) -> tuple[float, Float64Array]:
            weights, bias = parameters[:-1].astype(np.float32), np.float32(parameters[-1])
            errors = np.maximum(0, used - signs * (x @ weights + bias))
            slopes = -2 * self.C * (errors * signs)
            gradient = parameters + np.append(slopes @ x, slopes.sum())
            squares = float(np.square(errors, dtype=np.float64).sum())
            value = 0.5 * float(parameters @ parameters) + self.C * squares
            return scale * value, scale * gradient

        found = minimize(
            loss,
            np.zeros(x.shape[1] + 1),
            jac=True,
            method="L-BFGS-B",
            options={
                "maxiter": self.max_iter,
                "maxfun": 10 * self.max_iter,
                "maxcor": _CORRECTIONS,
                "ftol": _TOLERANCE,
                "gtol": 0,
            },
        )
        if found.status == 1:  # the iterations are used up
            warnings.warn("the solver has not converged", ConvergenceWarning, stacklevel=2)
        self.classes_ = np.array([False, True])
        self.coef_ = found.x[np.newaxis, :-1]
        self.intercept_ = found.x[-1:]
        return self

    def decision_function(self, rows: RowNumbers) -> Float32Array:
        """Return the signed distances, float32 `(m,)`: positive for the second class."""
        weights = self.coef_[0].astype(np.float32)
        blocks = (rows[start : start + _BLOCK] for start in range(0, len(rows), _BLOCK))
        parts = [self.vectors[block] @ weights for block in blocks]
        distances: Float32Array = np.concatenate([np.zeros(0, np.float32), *parts])
        return distances + np.float32(self.intercept_[0])

    def predict(self, rows: RowNumbers) -> BoolArray:
        """Return the classes, bool `(m,)`."""
        return self.decision_function(rows) > 0
