"""Trials: models fitted without some patches, or a ready model, and what they predict."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from vdet.boxes import BoolArray, Float64Array, Int64Array
from vdet.config.schema import Settings
from vdet.detect.svm.model import LinearModel
from vdet.errors import DataError
from vdet.learn.svm.extraction import LabelledVectors, hold_out
from vdet.learn.svm.fitting import fit

log = logging.getLogger("vdet")

TrialSplit = Literal["random", "tail", "groups"]
SPLITS: tuple[TrialSplit, ...] = get_args(TrialSplit)


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """The patches of a test and their probabilities.

    `rows` is int64 `(n,)`: rows of the data; `probabilities` is float64 `(n,)`. `fits` is the
    number of models that were fitted for it, 0 for a ready model.
    """

    name: str
    rows: Int64Array
    probabilities: Float64Array
    fits: int


def holdouts(data: LabelledVectors, settings: Settings, split: TrialSplit) -> list[BoolArray]:
    """Return the test parts of a split, bool `(n,)`, one for each model to fit.

    `random` and `tail` have one part, `groups` has one for each group. A group without which its
    class would be empty is never held out, with a warning.

    Raises
    ------
    DataError
        Nothing can be held out.
    """
    if split == "groups":
        parts = _group_holdouts(data)
    else:
        training = settings.train.svm
        parts = [hold_out(data.groups, split, training.test_fraction, training.seed)]
    if not any(part.any() for part in parts):
        raise DataError(f"split {split}: nothing can be held out; give more patches, more groups")
    return parts


def _group_holdouts(data: LabelledVectors) -> list[BoolArray]:
    from sklearn.model_selection import LeaveOneGroupOut

    parts = []
    if len(np.unique(data.groups)) > 1:
        for kept, tested in LeaveOneGroupOut().split(data.groups, groups=data.groups):
            if len(np.unique(data.vehicle[kept])) == 2:
                parts.append(np.isin(np.arange(len(data.groups)), tested))
            else:
                group = data.groups[tested[0]]
                log.warning("%s: is the only group of its class; it is not held out", group)
    return parts


def run_trial(
    name: TrialSplit,
    data: LabelledVectors,
    settings: Settings,
    parts: Sequence[BoolArray],
    progress: Callable[[int], object],
) -> Trial:
    """Fit for each part on all other patches, and predict the part. Raises `DataError`."""
    rows, probabilities = [], []
    for held in parts:
        model = fit(data.rows.of(~held), settings)
        rows.append(np.flatnonzero(held))
        probabilities.append(model.probabilities(data.vectors[held]).astype(np.float64))
        progress(1)
    return Trial(name, np.concatenate(rows), np.concatenate(probabilities), len(parts))


def model_trial(data: LabelledVectors, model: LinearModel) -> Trial:
    """Predict every patch with a ready model."""
    probabilities = model.probabilities(data.vectors).astype(np.float64)
    return Trial("model", np.arange(len(data.vehicle)), probabilities, 0)
