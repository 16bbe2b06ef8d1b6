"""Scale, fit, calibrate: scikit-learn's estimators → a `LinearModel` that needs none of them."""

import logging
import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from vdet.config.schema import FeatureSettings, TrainingSettings
from vdet.errors import DataError
from vdet.features import Vectors
from vdet.model import LinearModel

log = logging.getLogger("vdet")


def fit(
    vectors: Vectors,
    vehicle: npt.NDArray[np.bool_],
    features: FeatureSettings,
    settings: TrainingSettings,
) -> LinearModel:
    """Fit StandardScaler → LinearSVC → CalibratedClassifierCV on raw feature vectors.

    Parameters
    ----------
    vectors
        float32 of shape `(n, features)`.
    vehicle
        bool of shape `(n,)`.

    Raises
    ------
    DataError
        A class has fewer patches than there are calibration folds.
    """
    from sklearn.calibration import CalibratedClassifierCV
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.model_selection import StratifiedKFold
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import LinearSVC

    folds = settings.calibration.folds
    fewest = min(np.count_nonzero(vehicle), np.count_nonzero(~vehicle))
    if fewest < folds:
        raise DataError(
            f"a class has {fewest} training patches, training.calibration.folds needs {folds}; "
            "give more patches"
        )
    scaler = StandardScaler()
    scaled = scaler.fit_transform(vectors)
    svm = LinearSVC(C=settings.C, max_iter=settings.max_iterations, random_state=settings.seed)
    calibrated = CalibratedClassifierCV(
        svm,
        method="sigmoid",
        cv=StratifiedKFold(folds, shuffle=True, random_state=settings.seed),
        ensemble=settings.calibration.ensemble,
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ConvergenceWarning)
        calibrated.fit(scaled, vehicle)
    if any(issubclass(warning.category, ConvergenceWarning) for warning in caught):
        log.warning("the SVM has not converged; raise training.max_iterations or lower training.C")
    return _to_model(calibrated.calibrated_classifiers_, scaler, features)


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
