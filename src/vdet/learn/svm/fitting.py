"""Scale, fit and calibrate with scikit-learn; return a `LinearModel` that does not need it.

The classifier is that of scikit-learn's `LinearSVC`: squared hinge loss, L2 penalty on weights and
bias. liblinear, which `LinearSVC` calls, copies float32 data to six times their size; L-BFGS needs
only products of the data with a vector.
Source of the solver: Liu and Nocedal, "On the Limited Memory BFGS Method for Large Scale
Optimization", 1989.
"""

import logging
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.optimize import minimize  # type: ignore[import-untyped]
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.calibration import CalibratedClassifierCV
from sklearn.exceptions import ConvergenceWarning
from sklearn.model_selection import StratifiedKFold
from sklearn.preprocessing import StandardScaler

from vdet.boxes import BoolArray, Float32Array, Float64Array
from vdet.config.schema import Settings
from vdet.config.svm import FeatureSettings
from vdet.config.train import SvmTrainingSettings
from vdet.detect.svm.model import LinearModel
from vdet.errors import DataError
from vdet.learn.svm.extraction import LabelledVectors, RowNumbers

log = logging.getLogger("vdet")

FOLDS = 3
"""Folds of the cross-validation that calibrates."""
MAX_ITERATIONS = 1000
"""Most iterations of the solver."""
_BLOCK = 1024  # rows that are scaled or scored at a time
_CORRECTIONS = 20  # of L-BFGS
_TOLERANCE = 1e-9  # of the loss, relative to that of zero weights


def fit(rows: LabelledVectors, settings: Settings) -> LinearModel:
    """Fit StandardScaler → LinearSvm → CalibratedClassifierCV on raw feature vectors.

    The sigmoid is fitted on the patches alone, each scored by an SVM that was fitted without it and
    without the samples made of it.

    Parameters
    ----------
    rows
        Their vectors are overwritten, which saves memory.

    Raises
    ------
    DataError
        A class has fewer patches than there are calibration folds.
    """
    training = settings.train.svm
    fewest = min(np.count_nonzero(rows.labels), np.count_nonzero(~rows.labels))
    if fewest < FOLDS:
        raise DataError(
            f"a class has {fewest} training patches, calibration needs {FOLDS}; give more patches"
        )
    scaler = StandardScaler(copy=False)
    for start in range(0, len(rows.vectors), _BLOCK):  # as a whole, it needs twice their memory
        scaler.partial_fit(rows.vectors[start : start + _BLOCK])
    calibrated = CalibratedClassifierCV(
        LinearSvm(scaler.transform(rows.vectors), C=training.C, max_iter=MAX_ITERATIONS),
        method="sigmoid",
        cv=list(_folds(rows, training)),
        ensemble=training.ensemble,
    )
    numbers = np.arange(len(rows.vehicle))
    weights = (rows.origins == numbers).astype(float)  # samples do not count for the sigmoid
    with warnings.catch_warnings(record=True) as caught:
        warnings.filterwarnings("ignore", "Since .* does not appear to accept sample_weight")
        warnings.simplefilter("always", ConvergenceWarning)
        calibrated.fit(numbers, rows.vehicle, weights)
    if any(issubclass(warning.category, ConvergenceWarning) for warning in caught):
        log.warning("the SVM has not converged; lower train.svm.C")
    return _to_model(calibrated.calibrated_classifiers_, scaler, settings.svm.features)


def _folds(
    rows: LabelledVectors, training: SvmTrainingSettings
) -> Iterator[tuple[RowNumbers, RowNumbers]]:
    """Yield the rows to fit on and those to calibrate on."""
    splitter = StratifiedKFold(FOLDS, shuffle=True, random_state=training.seed)
    for _, tested in splitter.split(rows.labels, rows.labels):
        inside = np.isin(rows.origins, tested)
        yield np.flatnonzero(~inside), np.flatnonzero(inside)


def _to_model(members: list[Any], scaler: Any, features: FeatureSettings) -> LinearModel:
    """Fold the scaler into the weights: w·(x - μ)/σ + b = (w/σ)·x + (b - (w/σ)·μ)."""
    weights = np.concatenate([member.estimator.coef_ for member in members]) / scaler.scale_
    biases = np.concatenate([member.estimator.intercept_ for member in members])
    biases = biases - weights @ scaler.mean_
    sigmoids = [member.calibrators[0] for member in members]
    return LinearModel(
        features,
        weights.astype(np.float32),
        biases.astype(np.float32),
        np.array([sigmoid.a_ for sigmoid in sigmoids], np.float32),
        np.array([sigmoid.b_ for sigmoid in sigmoids], np.float32),
    )


class LinearSvm(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn has no types
    """A two-class linear SVM as a scikit-learn estimator, fitted in the memory of its data.

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

        limits = {"maxiter": self.max_iter, "maxfun": 10 * self.max_iter}
        options = {**limits, "maxcor": _CORRECTIONS, "ftol": _TOLERANCE, "gtol": 0}
        zeros = np.zeros(x.shape[1] + 1)
        found = minimize(loss, zeros, jac=True, method="L-BFGS-B", options=options)
        if found.status == 1:  # the iterations are used up
            warnings.warn("the solver has not converged", ConvergenceWarning, stacklevel=2)
        self.classes_ = np.array([False, True])
        self.coef_ = found.x[np.newaxis, :-1]
        self.intercept_ = found.x[-1:]
        return self

    def decision_function(self, rows: RowNumbers) -> Float32Array:
        """Return the signed distances, float32 `(m,)`: positive for the second class."""
        weights = self.coef_[0].astype(np.float32)
        distances = np.empty(len(rows), np.float32)
        for start in range(0, len(rows), _BLOCK):
            block = slice(start, start + _BLOCK)
            distances[block] = self.vectors[rows[block]] @ weights
        return distances + np.float32(self.intercept_[0])

    def predict(self, rows: RowNumbers) -> BoolArray:
        """Return the classes, bool `(m,)`; scikit-learn asks for it."""
        return self.decision_function(rows) > 0
