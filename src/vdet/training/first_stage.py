"""The first stage of the cascade: cheap features, a threshold that lets nearly all vehicles pass.

Source of the idea: Viola & Jones, "Rapid Object Detection using a Boosted Cascade of Simple
Features", 2001.
"""

import numpy as np
import numpy.typing as npt

from vdet.config.schema import FeatureSettings, TrainingSettings
from vdet.features import Layout, Vectors
from vdet.model import FirstStage


def fit_first_stage(
    vectors: Vectors,
    vehicle: npt.NDArray[np.bool_],
    features: FeatureSettings,
    settings: TrainingSettings,
) -> FirstStage:
    """Fit a linear SVM on the features of the first stage, and set its threshold.

    The threshold is where `first_stage.recall` of the vehicles pass, each scored by an SVM that has
    not seen it (cross-validation with the folds of the calibration).

    Parameters
    ----------
    vectors, vehicle
        As `fit` takes them.
    """
    from sklearn.model_selection import StratifiedKFold, cross_val_predict
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import LinearSVC

    seen = vectors[:, Layout.of(features).first_stage]
    svm = LinearSVC(C=settings.first_stage.C, random_state=settings.seed)
    classifier = make_pipeline(StandardScaler(), svm)
    folds = StratifiedKFold(settings.calibration.folds, shuffle=True, random_state=settings.seed)
    scores = cross_val_predict(classifier, seen, vehicle, cv=folds, method="decision_function")
    threshold = np.quantile(scores[vehicle], 1 - settings.first_stage.recall)
    classifier.fit(seen, vehicle)
    scaler, svm = classifier[0], classifier[1]
    weights = svm.coef_[0] / scaler.scale_
    bias = svm.intercept_ - weights @ scaler.mean_ - threshold
    return FirstStage(weights.astype(np.float32), np.asarray(bias, np.float32))
