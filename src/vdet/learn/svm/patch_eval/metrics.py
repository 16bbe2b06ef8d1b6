"""Metrics of the classifier with 95 % intervals, by scikit-learn and SciPy.

Source of the intervals: Efron and Tibshirani, "An Introduction to the Bootstrap", 1993, the
percentile interval. Patches are drawn one by one; with near-duplicates in the test the true
interval is wider.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vdet.boxes import BoolArray, Float64Array, Int64Array
from vdet.learn.svm.metrics import Confusion

METRICS = (
    *("accuracy", "precision", "recall", "f1"),
    *("roc_auc", "average_precision", "log_loss", "calibration_error"),
)

THRESHOLD = 0.5
"""A patch with at least this probability is classified as a vehicle."""

BINS = 10
"""Bins of the calibration, of equal width over the probabilities 0 to 1."""

RESAMPLES = 500
"""Draws of the bootstrap."""

_SEED = 0  # makes two runs agree
_PERCENTILES = (2.5, 97.5)
_AT_ONCE = 50  # draws that are in memory together


@dataclass(frozen=True, slots=True)
class Interval:
    """The 95 % interval of a metric."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class PatchScores:
    """The metrics on some patches; None if a metric has no meaning for them.

    `intervals` has the 95 % interval of each metric by its name.
    """

    patches: int
    vehicles: int
    accuracy: float | None
    precision: float | None
    recall: float | None
    f1: float | None
    roc_auc: float | None
    average_precision: float | None
    log_loss: float | None
    calibration_error: float | None
    confusion: Confusion
    intervals: dict[str, Interval] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ReliabilityBin:
    """Patches of similar probability: their number, mean probability and share of vehicles."""

    patches: int
    mean_probability: float
    vehicle_share: float


@dataclass(frozen=True, slots=True)
class RankingCurves:
    """Points of the ROC curve and the precision–recall curve."""

    false_positive_rates: tuple[float, ...]
    true_positive_rates: tuple[float, ...]
    precisions: tuple[float, ...]
    recalls: tuple[float, ...]


def patch_scores(vehicle: BoolArray, probabilities: Float64Array) -> PatchScores:
    """Return every metric with its interval.

    Parameters
    ----------
    vehicle
        bool `(n,)`: the truth, n > 0.
    probabilities
        float64 `(n,)`: the probability of being a vehicle.
    """
    found = metrics_of(vehicle, probabilities)
    return PatchScores(
        patches=len(vehicle),
        vehicles=int(np.count_nonzero(vehicle)),
        confusion=Confusion.of(vehicle, probabilities >= THRESHOLD),
        intervals=intervals(vehicle, probabilities),
        **{name: found.get(name) for name in METRICS},
    )


def metrics_of(vehicle: BoolArray, probabilities: Float64Array) -> dict[str, float]:
    """Return the metrics that have a meaning, by name; parameters as in `patch_scores`.

    If all patches are of one class, these are accuracy and, for vehicles, recall. Precision needs a
    patch that is classified as a vehicle.
    """
    from sklearn import metrics

    positive = probabilities >= THRESHOLD
    found: dict[str, float] = {"accuracy": metrics.accuracy_score(vehicle, positive)}
    if not vehicle.any():
        return found
    precision, found["recall"], f1, _ = metrics.precision_recall_fscore_support(
        vehicle, positive, average="binary", zero_division=np.nan
    )
    if vehicle.all():
        return found
    if positive.any():
        found["precision"] = precision
    return found | {
        "f1": f1,
        "roc_auc": metrics.roc_auc_score(vehicle, probabilities),
        "average_precision": metrics.average_precision_score(vehicle, probabilities),
        "log_loss": metrics.log_loss(vehicle, probabilities),
        "calibration_error": _calibration_error(vehicle, probabilities),
    }


def intervals(vehicle: BoolArray, probabilities: Float64Array) -> dict[str, Interval]:
    """Return the 95 % interval of every metric of `metrics_of`; parameters as there."""
    names = list(metrics_of(vehicle, probabilities))
    if vehicle.all() or not vehicle.any():  # recall is the accuracy
        right = (probabilities >= THRESHOLD) == vehicle
        draws = np.tile(_draws(np.mean, right, vectorized=True), (len(names), 1))
    else:

        def statistic(*data: Any) -> Float64Array:
            found = metrics_of(*data)
            return np.array([found.get(name, np.nan) for name in names])

        draws = _draws(statistic, vehicle, probabilities, vectorized=False)
    low, high = np.nanpercentile(draws, _PERCENTILES, axis=-1)
    return {
        name: Interval(*ends)
        for name, *ends in zip(names, low.tolist(), high.tolist(), strict=True)
    }


def _draws(
    statistic: Callable[..., Any], *data: BoolArray | Float64Array, vectorized: bool
) -> Float64Array:
    """Return the statistic of every resample, along the last axis."""
    from scipy.stats import DegenerateDataWarning, bootstrap  # type: ignore[import-untyped]

    if len(data[0]) < 2:  # every resample is the patch itself
        return np.asarray(statistic(*data))[..., np.newaxis]
    with warnings.catch_warnings():  # a resample of one class has NaN, which are left out
        warnings.simplefilter("ignore", DegenerateDataWarning)
        result = bootstrap(
            data,
            statistic,
            paired=True,
            vectorized=vectorized,
            n_resamples=RESAMPLES,
            batch=_AT_ONCE,
            method="percentile",
            random_state=_SEED,
        )
    return np.asarray(result.bootstrap_distribution)


def _bins(probabilities: Float64Array) -> Int64Array:
    """Return the bin, 0 to `BINS` - 1, of each probability; the last one includes 1."""
    return np.minimum((probabilities * BINS).astype(np.int64), BINS - 1)


def _calibration_error(vehicle: BoolArray, probabilities: Float64Array) -> float:
    """Return the expected calibration error: the mean gap of the bins, weighted by patches."""
    gaps = np.bincount(_bins(probabilities), weights=probabilities - vehicle)
    return float(np.abs(gaps).sum() / len(vehicle))


def reliability(vehicle: BoolArray, probabilities: Float64Array) -> tuple[ReliabilityBin, ...]:
    """Return the bins of the reliability curve that contain patches, lowest first."""
    bins = _bins(probabilities)
    return tuple(
        ReliabilityBin(
            patches=int(np.count_nonzero(bins == number)),
            mean_probability=float(probabilities[bins == number].mean()),
            vehicle_share=float(vehicle[bins == number].mean()),
        )
        for number in np.unique(bins).tolist()
    )


def ranking_curves(vehicle: BoolArray, probabilities: Float64Array) -> RankingCurves | None:
    """Return the curves; None if all patches are of one class."""
    from sklearn.metrics import precision_recall_curve, roc_curve

    if vehicle.all() or not vehicle.any():
        return None
    false_positives, true_positives, _ = roc_curve(vehicle, probabilities)
    precisions, recalls, _ = precision_recall_curve(vehicle, probabilities)
    return RankingCurves(
        tuple(false_positives.tolist()),
        tuple(true_positives.tolist()),
        tuple(precisions.tolist()),
        tuple(recalls.tolist()),
    )
