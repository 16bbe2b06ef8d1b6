"""Measures of a two-class classifier, under many weightings of the patches at once.

With all weights 1 they are the plain measures, as scikit-learn defines them; with the counts of
a resample they are one draw of a bootstrap.
"""

import numpy as np
import numpy.typing as npt

from vdet.geometry import Float64Array

Flags = npt.NDArray[np.bool_]

BINS = 10
"""Of equal width over the probabilities 0 to 1, for the calibration."""

THRESHOLD = 0.5
"""From this probability on a patch is said to be a vehicle."""

MEASURES = (
    *("accuracy", "precision", "recall", "f1"),
    *("roc_auc", "average_precision", "log_loss", "calibration_error"),
)


def measure(
    vehicle: Flags, probabilities: Float64Array, weights: Float64Array
) -> dict[str, Float64Array]:
    """Return every one of `MEASURES` for each of `k` weightings.

    Parameters
    ----------
    vehicle
        bool `(n,)`: the truth.
    probabilities
        float64 `(n,)`: of being a vehicle, sorted, the highest first.
    weights
        float64 `(k, n)`: how often each patch counts.

    Returns
    -------
    float64 `(k,)` each. NaN where there is nothing to divide by; where all patches are of one
    class, only accuracy and (of vehicles) recall have a meaning, and the others are NaN.
    """
    said = probabilities >= THRESHOLD
    vehicles, total = weights @ vehicle, weights.sum(axis=1)
    found, said_vehicles = weights @ (vehicle & said), weights @ said
    both = np.where((vehicles > 0) & (vehicles < total), 1.0, np.nan)
    roc_auc, average_precision = _ranking(vehicle, probabilities, weights)
    return {
        "accuracy": _ratio(weights @ (vehicle == said), total),
        "precision": both * _ratio(found, said_vehicles),
        "recall": _ratio(found, vehicles),
        "f1": both * _ratio(2 * found, said_vehicles + vehicles),
        "roc_auc": both * roc_auc,
        "average_precision": both * average_precision,
        "log_loss": both * _ratio(weights @ _losses(vehicle, probabilities), total),
        "calibration_error": both * _ratio(_bin_gaps(vehicle, probabilities, weights), total),
    }


def bins_of(probabilities: Float64Array) -> npt.NDArray[np.int64]:
    """Return the bin, 0 to `BINS` - 1, that each probability falls into; the last holds 1 too."""
    return np.minimum((probabilities * BINS).astype(np.int64), BINS - 1)


def _ranking(
    vehicle: Flags, probabilities: Float64Array, weights: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return the area under the ROC curve and the average precision; equal probabilities tie."""
    ends = np.append(np.flatnonzero(np.diff(probabilities)), len(probabilities) - 1)
    everything = np.cumsum(weights, axis=1)[:, ends]
    vehicles = np.cumsum(weights * vehicle, axis=1)[:, ends]
    others = everything - vehicles
    new_vehicles = np.diff(vehicles, axis=1, prepend=0)
    area = np.sum(np.diff(others, axis=1, prepend=0) * (vehicles - new_vehicles / 2), axis=1)
    precision = vehicles / np.maximum(everything, np.finfo(np.float64).tiny)
    return (
        _ratio(area, vehicles[:, -1] * others[:, -1]),
        _ratio(np.sum(new_vehicles * precision, axis=1), vehicles[:, -1]),
    )


def _losses(vehicle: Flags, probabilities: Float64Array) -> Float64Array:
    """Return minus the logarithm of the probability given to the truth, kept finite."""
    smallest = np.finfo(np.float64).eps
    given = np.where(vehicle, probabilities, 1 - probabilities)
    return np.asarray(-np.log(np.clip(given, smallest, 1 - smallest)))


def _bin_gaps(vehicle: Flags, probabilities: Float64Array, weights: Float64Array) -> Float64Array:
    """Return Σ over the bins of |vehicles expected - vehicles there|: ECE times the total."""
    in_bin = np.arange(BINS) == bins_of(probabilities)[:, np.newaxis]
    surplus = weights @ (in_bin * (probabilities - vehicle)[:, np.newaxis])
    return np.asarray(np.abs(surplus).sum(axis=1))


def _ratio(part: Float64Array, whole: Float64Array) -> Float64Array:
    ratio: Float64Array = np.divide(part, whole, out=np.full(part.shape, np.nan), where=whole > 0)
    return ratio
