"""Scale, fit and calibrate with scikit-learn; return a `LinearModel` that does not need it."""

import logging
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from vdet.boxes import BoolArray, Float32Array, Float64Array
from vdet.config.schema import FeatureSettings, Settings, SvmTrainingSettings
from vdet.detect.svm.model import LinearModel
from vdet.errors import DataError
from vdet.learn.svm.extraction import LabelledVectors, RowNumbers
from vdet.learn.svm.training_set import training_set

log = logging.getLogger("vdet")

_BLOCK = 1024
"""Rows whose mean and variance are computed at a time."""


def fit_patches(data: LabelledVectors, kept: BoolArray, settings: Settings) -> LinearModel:
    """Fit on the kept patches, bool `(n,)`, and the samples made of these; errors as of `fit`."""
    samples = training_set(data, kept)
    return fit(
        samples.vectors,
        samples.vehicle,
        settings.svm.features,
        settings.train.svm,
        samples.origins,
        copy=False,
    )


def fit(
    vectors: Float32Array,
    vehicle: BoolArray,
    features: FeatureSettings,
    settings: SvmTrainingSettings,
    origins: RowNumbers | None = None,
    *,
    copy: bool = True,
) -> LinearModel:
    """Fit StandardScaler → LinearSvm → CalibratedClassifierCV on raw feature vectors.

    Parameters
    ----------
    vectors
        float32 `(n, features)`.
    vehicle
        bool `(n,)`.
    origins
        intp `(n,)`: the row of the patch that each row was made of; a patch has its own row. The
        sigmoid is fitted on the patches alone, each scored by an SVM that was fitted without it and
        without the samples made of it. None: all rows are patches.
    copy
        False: `vectors` are overwritten, which saves memory.

    Raises
    ------
    DataError
        A class has fewer patches than there are calibration folds.
    """
    from sklearn.calibration import CalibratedClassifierCV
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.preprocessing import StandardScaler

    from vdet.learn.svm.linear_svm import LinearSvm

    origins = np.arange(len(vehicle)) if origins is None else origins
    folds = settings.calibration.folds
    (patches,) = np.nonzero(origins == np.arange(len(origins)))
    fewest = min(np.count_nonzero(vehicle[patches]), np.count_nonzero(~vehicle[patches]))
    if fewest < folds:
        raise DataError(
            f"a class has {fewest} training patches, train.svm.calibration.folds needs {folds}; "
            "give more patches"
        )
    scaler = StandardScaler(copy=copy)
    for start in range(0, len(vectors), _BLOCK):  # as a whole, it needs twice their memory
        scaler.partial_fit(vectors[start : start + _BLOCK])
    scaled = scaler.transform(vectors)
    calibrated = CalibratedClassifierCV(
        LinearSvm(scaled, C=settings.C, max_iter=settings.max_iterations),
        method="sigmoid",
        cv=list(_folds(vehicle[patches], patches, origins, settings)),
        ensemble=settings.calibration.ensemble,
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.filterwarnings("ignore", "Since .* does not appear to accept sample_weight")
        warnings.simplefilter("always", ConvergenceWarning)
        calibrated.fit(np.arange(len(vehicle)), vehicle, _weights(patches, len(vehicle)))
    if any(issubclass(warning.category, ConvergenceWarning) for warning in caught):
        log.warning(
            "the SVM has not converged; raise train.svm.max_iterations or lower train.svm.C"
        )
    return _to_model(calibrated.calibrated_classifiers_, scaler, features)


def _weights(patches: RowNumbers, count: int) -> Float64Array:
    """Return the weights for the sigmoid: 1 for patches, 0 for augmented samples."""
    weights = np.zeros(count)
    weights[patches] = 1
    return weights


def _folds(
    vehicle: BoolArray, patches: RowNumbers, origins: RowNumbers, settings: SvmTrainingSettings
) -> Iterator[tuple[RowNumbers, RowNumbers]]:
    """Yield the rows to fit on and to calibrate on; `vehicle` holds the labels of `patches`."""
    from sklearn.model_selection import StratifiedKFold

    splitter = StratifiedKFold(settings.calibration.folds, shuffle=True, random_state=settings.seed)
    for _, tested in splitter.split(patches, vehicle):
        inside = np.isin(origins, patches[tested])
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
