"""Patch files → tests of a ready model or of fresh ones → a report."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from vdet.config.schema import FeatureSettings, Settings
from vdet.detect.svm.model import LinearModel
from vdet.learn.augmentation import Look, views_of
from vdet.learn.dataset import PatchFile, read_patches
from vdet.learn.extraction import LabelledVectors, extract
from vdet.learn.patch_eval.results import PatchReport
from vdet.learn.patch_eval.summary import sum_up
from vdet.learn.patch_eval.trials import SplitName, Trial, holdouts, model_trial, run_trial
from vdet.workers import make_workers

Advance = Callable[[int], object]
Progress = Callable[[int | None], Advance]

_MEANINGS = {
    "random": "random split: near-duplicates of test patches stand in the training part",
    "tail": "tail split: leak-free, the last patches of each folder are tested",
    "groups": "leave one group out: each group is judged by a model that saw none of it",
}


def evaluate_splits(
    files: Sequence[PatchFile],
    settings: Settings,
    splits: Sequence[SplitName],
    *,
    jobs: int | None = None,
    progress: Progress = lambda _: lambda _: None,
) -> PatchReport:
    """Train afresh for each split, and test on what was held out.

    Parameters
    ----------
    jobs
        Processes that describe patches; None for one for each core.
    progress
        Called with the number of patches to describe, then with that of fits to make; what it
        returns is called with the number done since the last call.

    Raises
    ------
    DataError
        Too many patches are unreadable, or too few are there for a split.
    """
    look = partial(views_of, settings=settings.training.views)
    data = _extract(files, settings, settings.svm.features, jobs, progress(len(files)), look=look)
    plans = [(split, holdouts(data, settings, split)) for split in splits]
    advance = progress(sum(len(parts) for _, parts in plans))
    trials = [run_trial(split, data, settings, parts, advance) for split, parts in plans]
    return _report(files, data, [(trial, _MEANINGS[trial.name]) for trial in trials])


def evaluate_model(
    files: Sequence[PatchFile],
    model: LinearModel,
    settings: Settings,
    *,
    jobs: int | None = None,
    progress: Progress = lambda _: lambda _: None,
) -> PatchReport:
    """Test a ready model on all patches; parameters and errors as in `evaluate_splits`."""
    data = _extract(files, settings, model.features, jobs, progress(len(files)))
    return _report(files, data, [(model_trial(data, model), _origin(model, data))])


def _extract(
    files: Sequence[PatchFile],
    settings: Settings,
    features: FeatureSettings,
    jobs: int | None,
    advance: Advance,
    *,
    look: Look | None = None,
) -> LabelledVectors:
    return extract(
        files,
        features,
        max_broken=settings.training.max_broken,
        look=look,
        seed=settings.training.seed,
        workers=make_workers(jobs),
        progress=advance,
    )


def _origin(model: LinearModel, data: LabelledVectors) -> str:
    """Say what the model's training has to do with these patches."""
    digest = model.provenance.get("data_sha256")
    if digest == data.digest:
        return "the model was trained on most of these very patches: the scores flatter it"
    if digest is None:
        return (
            "the model does not say what it was trained on; if it was on some of these patches, "
            "the scores flatter it"
        )
    return (
        "the model was trained on another set of patches; if some are in both, "
        "the scores flatter it"
    )


def _report(
    files: Sequence[PatchFile], data: LabelledVectors, trials: Sequence[tuple[Trial, str]]
) -> PatchReport:
    kept = files
    if data.broken:
        kept = [patch.file for patch in read_patches(files) if patch.image is not None]
    vehicles = int(np.count_nonzero(data.vehicle))
    to_report = partial(sum_up, data=data, files=kept)
    return PatchReport(
        vehicles=vehicles,
        non_vehicles=len(data.vehicle) - vehicles,
        broken=data.broken,
        trials=tuple(to_report(trial, meaning) for trial, meaning in trials),
    )
