"""A trial's probabilities → its report."""

from collections.abc import Sequence

import numpy as np

from vdet.geometry import Float64Array
from vdet.learn.dataset import PatchFile
from vdet.learn.extraction import LabelledVectors
from vdet.learn.patch_eval.bootstrap import intervals
from vdet.learn.patch_eval.measures import MEASURES, THRESHOLD, Flags, bins_of, measure
from vdet.learn.patch_eval.results import (
    Curves,
    GroupScores,
    Mistake,
    PatchScores,
    ReliabilityBin,
    TrialReport,
)
from vdet.learn.patch_eval.trials import Trial
from vdet.learn.report import Confusion

WORST = 24
"""Mistakes of either kind that are kept."""


def sum_up(
    trial: Trial, meaning: str, *, data: LabelledVectors, files: Sequence[PatchFile]
) -> TrialReport:
    """Measure a trial; `files` are the patches of `data`, row by row."""
    vehicle, groups = data.vehicle[trial.rows], data.groups[trial.rows]
    probabilities = trial.probabilities
    return TrialReport(
        name=trial.name,
        meaning=meaning,
        scores=patch_scores(vehicle, probabilities),
        groups=tuple(
            GroupScores(
                group, patch_scores(vehicle[groups == group], probabilities[groups == group])
            )
            for group in np.unique(groups).tolist()
        ),
        reliability=reliability(vehicle, probabilities),
        curves=_curves(vehicle, probabilities),
        mistakes=_mistakes([files[row] for row in trial.rows.tolist()], vehicle, probabilities),
    )


def patch_scores(vehicle: Flags, probabilities: Float64Array) -> PatchScores:
    """Return every measure, with its interval.

    Parameters
    ----------
    vehicle
        bool `(n,)`: the truth.
    probabilities
        float64 `(n,)`: of being a vehicle.
    """
    order = np.argsort(-probabilities, kind="stable")
    vehicle, probabilities = vehicle[order], probabilities[order]
    point = measure(vehicle, probabilities, np.ones((1, len(vehicle))))
    values = {name: float(point[name][0]) for name in MEASURES}
    known = {name: value for name, value in values.items() if not np.isnan(value)}
    found = intervals(vehicle, probabilities)
    return PatchScores(
        patches=len(vehicle),
        vehicles=int(np.count_nonzero(vehicle)),
        confusion=Confusion.of(vehicle, probabilities >= THRESHOLD),
        intervals={name: interval for name, interval in found.items() if name in known},
        **{name: known.get(name) for name in MEASURES},
    )


def reliability(vehicle: Flags, probabilities: Float64Array) -> tuple[ReliabilityBin, ...]:
    """Return the bins of the reliability curve that hold patches, lowest first."""
    bins = bins_of(probabilities)
    return tuple(
        ReliabilityBin(
            patches=int(np.count_nonzero(bins == number)),
            mean_probability=float(probabilities[bins == number].mean()),
            vehicle_share=float(vehicle[bins == number].mean()),
        )
        for number in np.unique(bins).tolist()
    )


def _curves(vehicle: Flags, probabilities: Float64Array) -> Curves | None:
    from sklearn.metrics import precision_recall_curve, roc_curve

    if vehicle.all() or not vehicle.any():
        return None
    false_positives, true_positives, _ = roc_curve(vehicle, probabilities)
    precisions, recalls, _ = precision_recall_curve(vehicle, probabilities)
    return Curves(
        tuple(false_positives.tolist()),
        tuple(true_positives.tolist()),
        tuple(precisions.tolist()),
        tuple(recalls.tolist()),
    )


def _mistakes(
    files: Sequence[PatchFile], vehicle: Flags, probabilities: Float64Array
) -> tuple[Mistake, ...]:
    """Return the worst `WORST` missed vehicles and false alarms, the surest first."""
    sureness = np.abs(probabilities - THRESHOLD)
    wrong = (probabilities >= THRESHOLD) != vehicle
    rows: list[int] = []
    for kind in (wrong & vehicle, wrong & ~vehicle):
        candidates = np.flatnonzero(kind)
        rows += candidates[np.argsort(-sureness[candidates], kind="stable")][:WORST].tolist()
    rows.sort(key=lambda row: -sureness[row])
    return tuple(Mistake(files[row], float(probabilities[row])) for row in rows)
