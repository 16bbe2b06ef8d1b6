"""Which patches are held out from which fit, and what was said of them."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from vdet.config.schema import Settings
from vdet.detect.svm.features import Vectors
from vdet.detect.svm.model import LinearModel
from vdet.errors import DataError
from vdet.geometry import Float64Array, Int64Array
from vdet.learn.extraction import LabelledVectors
from vdet.learn.fitting import fit
from vdet.learn.splits import Held, hold_out
from vdet.learn.training_set import lesson_of

log = logging.getLogger("vdet")

SplitName = Literal["random", "tail", "groups"]
SPLITS: tuple[SplitName, ...] = get_args(SplitName)


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """The patches of a test, and the probabilities that they were given.

    `rows` is int64 `(n,)`: rows of the data; `probabilities` is float64 `(n,)`. `fits` is the
    number of models that gave them, 0 where a ready one did.
    """

    name: str
    rows: Int64Array
    probabilities: Float64Array
    fits: int


def holdouts(data: LabelledVectors, settings: Settings, split: SplitName) -> list[Held]:
    """Return the test parts of a split, one a fit.

    `random` and `tail` have one part, `groups` has one for each group; a group without which its
    class would be empty is never held out (a warning tells so).

    Raises
    ------
    DataError
        Nothing can be held out.
    """
    if split == "groups":
        parts = [data.groups == group for group in _spare_groups(data)]
    else:
        training = settings.training
        parts = [hold_out(data.groups, split, training.test_fraction, training.seed)]
    if not any(part.any() for part in parts):
        raise DataError(f"split {split}: nothing can be held out; give more patches, more groups")
    return parts


def _spare_groups(data: LabelledVectors) -> list[str]:
    spare = []
    for group in np.unique(data.groups).tolist():
        of_class = data.vehicle == data.vehicle[data.groups == group][0]
        if (data.groups[of_class] == group).all():
            log.warning("%s: is the only group of its class; it is not held out", group)
        else:
            spare.append(group)
    return spare


def run_trial(
    name: SplitName,
    data: LabelledVectors,
    settings: Settings,
    parts: Sequence[Held],
    progress: Callable[[int], object],
) -> Trial:
    """Fit once for each part, on everything else, and predict that part. Raises `DataError`."""
    rows, probabilities = [], []
    for held in parts:
        lesson = lesson_of(data, ~held)
        model = fit(
            lesson.vectors, lesson.vehicle, settings.svm.features, settings.training, lesson.origins
        )
        rows.append(np.flatnonzero(held))
        probabilities.append(_probabilities(model, data.vectors[held]))
        progress(1)
    return Trial(name, np.concatenate(rows), np.concatenate(probabilities), len(parts))


def model_trial(data: LabelledVectors, model: LinearModel) -> Trial:
    """Predict every patch by a ready model."""
    rows = np.arange(len(data.vehicle))
    return Trial("model", rows, _probabilities(model, data.vectors), 0)


def _probabilities(model: LinearModel, vectors: Vectors) -> Float64Array:
    return model.probabilities(vectors).astype(np.float64)
