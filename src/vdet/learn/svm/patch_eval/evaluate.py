"""Tests of a ready model, or of freshly trained ones, on labelled patches."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from vdet.boxes import BoolArray, Float64Array
from vdet.config.schema import FeatureSettings, Settings
from vdet.detect.svm.model import LinearModel
from vdet.learn.svm.augmentation import Augmenter, augment
from vdet.learn.svm.dataset import PatchFile, read_patches
from vdet.learn.svm.extraction import LabelledVectors, extract
from vdet.learn.svm.patch_eval.metrics import (
    THRESHOLD,
    PatchScores,
    RankingCurves,
    ReliabilityBin,
    patch_scores,
    ranking_curves,
    reliability,
)
from vdet.learn.svm.patch_eval.trials import Trial, TrialSplit, holdouts, model_trial, run_trial
from vdet.progress import Advance, Steps, no_steps
from vdet.workers import make_workers

MOST_MISTAKES = 24
"""Most mistakes of either kind in a report."""

_MEANINGS = {
    "random": "random split: near-duplicates of test patches are in the training part",
    "tail": "tail split: leak-free, the last patches of each folder are tested",
    "groups": "leave one group out: each group is tested by a model trained without it",
}


@dataclass(frozen=True, slots=True)
class GroupScores:
    """The scores on the test patches of one group, all of one class."""

    group: str
    scores: PatchScores


@dataclass(frozen=True, slots=True)
class Mistake:
    """A patch that is classified wrongly, and its probability of being a vehicle."""

    file: PatchFile
    probability: float


@dataclass(frozen=True, slots=True)
class TrialReport:
    """A test: its name, its meaning and its results.

    `reliability` has no empty bins. The mistakes with the most wrong probabilities come first.
    """

    name: str
    meaning: str
    scores: PatchScores
    groups: tuple[GroupScores, ...]
    reliability: tuple[ReliabilityBin, ...]
    curves: RankingCurves | None
    mistakes: tuple[Mistake, ...]


@dataclass(frozen=True, slots=True)
class PatchReport:
    """The numbers of patches in a data set, and the tests on them."""

    vehicles: int
    non_vehicles: int
    broken: int
    trials: tuple[TrialReport, ...]


def evaluate_splits(
    files: Sequence[PatchFile],
    settings: Settings,
    splits: Sequence[TrialSplit],
    *,
    jobs: int | None = None,
    steps: Steps = no_steps,
) -> PatchReport:
    """Train for each split, and test on the patches that were held out.

    Parameters
    ----------
    jobs
        Processes that describe patches, as joblib counts them: -1 for one per core.
    steps
        Called at the start of each step, with the number of patches to describe, of models to fit,
        or None; what it returns is called with the number done since the last call.

    Raises
    ------
    DataError
        Too many patches are unreadable, or there are too few for a split.
    """
    augmenter = partial(augment, settings=settings.train.svm.augmentation)
    advance = steps("describing patches", len(files))
    data = _extract(files, settings, settings.svm.features, jobs, advance, augmenter=augmenter)
    plans = [(split, holdouts(data, settings, split)) for split in splits]
    advance = steps("fitting models", sum(len(parts) for _, parts in plans))
    trials = [run_trial(split, data, settings, parts, advance) for split, parts in plans]
    steps("computing scores", None)
    return _report(files, data, [(trial, _MEANINGS[trial.name]) for trial in trials])


def evaluate_model(
    files: Sequence[PatchFile],
    model: LinearModel,
    settings: Settings,
    *,
    jobs: int | None = None,
    steps: Steps = no_steps,
) -> PatchReport:
    """Test a ready model on all patches; parameters and errors as in `evaluate_splits`."""
    advance = steps("describing patches", len(files))
    data = _extract(files, settings, model.features, jobs, advance)
    steps("computing scores", None)
    return _report(files, data, [(model_trial(data, model), _origin(model, data))])


def _extract(
    files: Sequence[PatchFile],
    settings: Settings,
    features: FeatureSettings,
    jobs: int | None,
    advance: Advance,
    *,
    augmenter: Augmenter | None = None,
) -> LabelledVectors:
    return extract(
        files,
        features,
        settings.train.svm,
        augmenter=augmenter,
        workers=make_workers(jobs),
        progress=advance,
    )


def _origin(model: LinearModel, data: LabelledVectors) -> str:
    """Return how the training data of the model are related to these patches."""
    digest = model.provenance.get("data_sha256")
    if digest == data.digest:
        return "the model was trained on most of these very patches: the scores are too good"
    if digest is None:
        return (
            "the model does not say what it was trained on; if some of these patches were among "
            "it, the scores are too good"
        )
    return (
        "the model was trained on another set of patches; if some are in both, the scores are too "
        "good"
    )


def _report(
    files: Sequence[PatchFile], data: LabelledVectors, trials: Sequence[tuple[Trial, str]]
) -> PatchReport:
    kept = files
    if data.broken:
        kept = [patch.file for patch in read_patches(files) if patch.image is not None]
    vehicles = int(np.count_nonzero(data.vehicle))
    return PatchReport(
        vehicles=vehicles,
        non_vehicles=len(data.vehicle) - vehicles,
        broken=data.broken,
        trials=tuple(report_trial(trial, meaning, data, kept) for trial, meaning in trials),
    )


def report_trial(
    trial: Trial, meaning: str, data: LabelledVectors, files: Sequence[PatchFile]
) -> TrialReport:
    """Compute the metrics of a trial; `files` are the patches of `data`, row by row."""
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
        curves=ranking_curves(vehicle, probabilities),
        mistakes=_mistakes([files[row] for row in trial.rows.tolist()], vehicle, probabilities),
    )


def _mistakes(
    files: Sequence[PatchFile], vehicle: BoolArray, probabilities: Float64Array
) -> tuple[Mistake, ...]:
    """Return the worst `MOST_MISTAKES` missed vehicles and false alarms, the worst first."""
    distances = np.abs(probabilities - THRESHOLD)
    wrong = (probabilities >= THRESHOLD) != vehicle
    rows: list[int] = []
    for kind in (wrong & vehicle, wrong & ~vehicle):
        candidates = np.flatnonzero(kind)
        order = np.argsort(-distances[candidates], kind="stable")
        rows += candidates[order][:MOST_MISTAKES].tolist()
    rows.sort(key=lambda row: -distances[row])
    return tuple(Mistake(files[row], float(probabilities[row])) for row in rows)
