"""Scale, fit and calibrate: feature vectors → a `LinearModel`.

The classifier is that of scikit-learn's `LinearSVC`: squared hinge loss, L2 penalty on weights and
bias. liblinear, which `LinearSVC` calls, copies float32 data to six times their size; L-BFGS needs
only products of the data with a vector.
Sources: of the solver, Liu and Nocedal, "On the Limited Memory BFGS Method for Large Scale
Optimization", 1989; of the calibration, Platt, "Probabilistic outputs for support vector machines",
1999.
"""

import logging
from typing import Any

import numpy as np
from scipy.optimize import minimize  # type: ignore[import-untyped]
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import StratifiedKFold
from sklearn.preprocessing import StandardScaler

from vdet.boxes import BoolArray, Float32Array, Float64Array
from vdet.config.schema import Settings
from vdet.detect.svm.model import LinearModel
from vdet.errors import DataError
from vdet.learn.svm.extraction import LabelledVectors

log = logging.getLogger("vdet")

FOLDS = 3
"""Folds of the cross-validation that calibrates."""
MAX_ITERATIONS = 1000
"""Most iterations of the solver."""
_BLOCK = 1024  # rows that are scaled at a time
_CORRECTIONS = 20  # of L-BFGS
_TOLERANCE = 1e-9  # of the loss, relative to that of zero weights


def fit(rows: LabelledVectors, settings: Settings) -> LinearModel:
    """Scale the features, fit one or several linear SVMs, and calibrate each by a sigmoid.

    The sigmoid is fitted to the patches alone, each scored by an SVM that was fitted without it and
    without the samples made of it. The scaling becomes part of the weights.

    Parameters
    ----------
    rows
        Their vectors are overwritten, which saves memory.

    Raises
    ------
    DataError
        A class has fewer patches than there are calibration folds.
    """
    training, labels = settings.train.svm, rows.labels
    fewest = min(np.count_nonzero(labels), np.count_nonzero(~labels))
    if fewest < FOLDS:
        raise DataError(f"a class has {fewest} training patches, and {FOLDS} are needed; give more")
    scaler = StandardScaler(copy=False)
    for start in range(0, len(rows.vectors), _BLOCK):  # as a whole, it needs twice their memory
        scaler.partial_fit(rows.vectors[start : start + _BLOCK])
    vectors, patches = scaler.transform(rows.vectors), rows.patches
    svms, sigmoids, scores = [], [], np.zeros(len(labels))
    folds = StratifiedKFold(FOLDS, shuffle=True, random_state=training.seed)
    for _, tested in folds.split(labels, labels):
        svm = _fit_svm(vectors, rows.vehicle, ~np.isin(rows.origins, tested), training.C)
        scores[tested] = vectors[patches[tested]] @ svm.x[:-1].astype(np.float32) + svm.x[-1]
        svms.append(svm)
        sigmoids.append(_fit_sigmoid(scores[tested], labels[tested]))
    if not training.ensemble:
        everything = np.ones(len(vectors), bool)
        svms = [_fit_svm(vectors, rows.vehicle, everything, training.C)]
        sigmoids = [_fit_sigmoid(scores, labels)]
    if any(svm.status == 1 for svm in svms):  # the iterations are used up
        log.warning("the SVM has not converged; lower train.svm.C")
    # w·(x - μ)/σ + b = (w/σ)·x + (b - (w/σ)·μ)
    weights = np.array([svm.x[:-1] for svm in svms]) / scaler.scale_
    biases = np.array([svm.x[-1] for svm in svms]) - weights @ scaler.mean_
    slopes, offsets = np.array(sigmoids, np.float32).T
    planes = weights.astype(np.float32), biases.astype(np.float32)
    return LinearModel(settings.svm.features, *planes, slopes, offsets)


def _fit_svm(vectors: Float32Array, vehicle: BoolArray, used: BoolArray, penalty: float) -> Any:
    """Fit a linear SVM to the used rows; `x` of the result has the weights, and the bias last."""
    # All vectors take part in the products: a copy of some would take their memory again.
    signs = np.where(vehicle, used, -1.0 * used).astype(np.float32)
    scale = 1 / (penalty * np.count_nonzero(used))  # the loss of zero weights becomes 1

    def loss(parameters: Float64Array) -> tuple[float, Float64Array]:
        weights, bias = parameters[:-1].astype(np.float32), np.float32(parameters[-1])
        errors = np.maximum(0, used - signs * (vectors @ weights + bias))
        slopes = -2 * penalty * (errors * signs)
        gradient = parameters + np.append(slopes @ vectors, slopes.sum())
        squares = float(np.square(errors, dtype=np.float64).sum())
        value = 0.5 * float(parameters @ parameters) + penalty * squares
        return scale * value, scale * gradient

    limits = {"maxiter": MAX_ITERATIONS, "maxfun": 10 * MAX_ITERATIONS}
    options = {**limits, "maxcor": _CORRECTIONS, "ftol": _TOLERANCE, "gtol": 0}
    zeros = np.zeros(vectors.shape[1] + 1)
    return minimize(loss, zeros, jac=True, method="L-BFGS-B", options=options)


def _fit_sigmoid(scores: Float64Array, vehicle: BoolArray) -> tuple[float, float]:
    """Return slope and offset of the sigmoid 1 / (1 + exp(slope · score + offset)).

    The targets are Platt's: not quite 1 and 0, and the less so the fewer patches there are.
    """
    positives, negatives = np.count_nonzero(vehicle), np.count_nonzero(~vehicle)
    targets = np.where(vehicle, (positives + 1) / (positives + 2), 1 / (negatives + 2))
    values, signs = np.tile(scores, 2)[:, np.newaxis], np.repeat([True, False], len(scores))
    weights = np.concatenate([targets, 1 - targets])
    found = LogisticRegression(C=np.inf, tol=1e-8).fit(values, signs, weights)
    return -found.coef_[0, 0], -found.intercept_[0]
