"""What the regression of boxes learns from, and how far it is off on what was held out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vdet.config.schema import Settings, TrainingSettings
from vdet.detect.svm.features import Layout, Vectors
from vdet.detect.svm.model import BoxRegression
from vdet.learn.augmentation import closer, views_of
from vdet.learn.dataset import PatchFile, Sides
from vdet.learn.extraction import LabelledVectors, SidesTable, extract
from vdet.learn.regression import Weights, fit_boxes
from vdet.learn.report import BoxError
from vdet.learn.splits import Held, SplitName, hold_out
from vdet.learn.training_set import Lesson, lesson_of
from vdet.workers import Workers

_FILLED: Sides = (-0.47, -0.40, 0.47, 0.42)
"""Where a vehicle is in a patch of the Udacity set, as a rule."""


@dataclass(frozen=True, slots=True, eq=False)
class BoxPatches:
    """Patches for the regression alone, each None where there are none.

    `boxed` are of neither class; `filled` are the vehicles from sources without boxes.
    """

    boxed: LabelledVectors | None
    filled: LabelledVectors | None


def describe_boxes(
    files: Sequence[PatchFile],
    boxed: Sequence[PatchFile],
    settings: Settings,
    *,
    workers: Workers,
    progress: Callable[[int], object],
) -> BoxPatches | None:
    """Describe what the regression learns from besides `files`; None where no box is known.

    Without HOG among the features nothing can be regressed, and it is None too.

    Raises
    ------
    DataError
        Too many patches are unreadable.
    """
    told = {file.source for file in (*files, *boxed) if file.sides}
    if not told or not settings.svm.features.hog.channels:
        return None
    training = settings.training
    describe = partial(
        extract, settings=settings.svm.features, max_broken=training.max_broken, workers=workers
    )
    whole = training.views.model_copy(update={"parts": 0.0})  # parts have no box
    look = partial(views_of, settings=whole)
    filled = [
        replace(file, sides=_FILLED)
        for file in files
        if file.vehicle and file.source not in told and training.boxes.assumed
    ]
    return BoxPatches(
        describe(boxed, look=look, seed=training.seed, progress=progress) if boxed else None,
        describe(filled, look=closer, seed=training.seed) if filled else None,
    )


def fit_split_boxes(
    data: LabelledVectors, held: Held, boxes: BoxPatches, name: SplitName, settings: Settings
) -> tuple[BoxRegression | None, BoxError | None]:
    """Fit on what is not held out, and try the rest; None where nothing is left for either.

    Parameters
    ----------
    held
        Of `data`; from `boxes` the same split holds out its share.
    """
    training = settings.training
    length = Layout.of(settings.svm.features).hog_length
    parts = [(data, held)]
    if boxes.boxed is not None:
        parts.append((boxes.boxed, _held(boxes.boxed, name, training)))
    filled = None
    if boxes.filled is not None:
        filled = lesson_of(boxes.filled, ~_held(boxes.filled, name, training))
    regression = learn_boxes([lesson_of(each, ~out) for each, out in parts], filled, settings)
    if regression is None:
        return None, None
    tried = _Told.joined([_Told.of(_patches(each, out), length) for each, out in parts])
    return regression, _error(regression, tried)


def learn_boxes(
    lessons: Sequence[Lesson], filled: Lesson | None, settings: Settings
) -> BoxRegression | None:
    """Fit on lessons that tell sides, and, for less, on `filled`; None where no side is told."""
    length = Layout.of(settings.svm.features).hog_length
    learnt = [_Told.of(lesson, length) for lesson in lessons]
    known = sum(len(told.sides) for told in learnt)
    if not known:
        return None
    if filled is not None:
        weight = settings.training.boxes.assumed * known / len(filled.sides)
        learnt.append(_Told.of(filled, length, weight))
    told = _Told.joined(learnt)
    return fit_boxes(told.hogs, told.sides, settings.training.boxes.penalty, told.weights)


@dataclass(frozen=True, slots=True, eq=False)
class _Told:
    """Rows of which at least one side is known, with the weight of each."""

    hogs: Vectors
    sides: SidesTable
    weights: Weights

    @staticmethod
    def of(lesson: Lesson, length: int, weight: float = 1.0) -> "_Told":
        known = np.isfinite(lesson.sides).any(axis=1)
        weights = np.full(np.count_nonzero(known), weight, np.float32)
        return _Told(lesson.vectors[known, :length], lesson.sides[known], weights)

    @staticmethod
    def joined(parts: Sequence["_Told"]) -> "_Told":
        return _Told(
            np.concatenate([part.hogs for part in parts]),
            np.concatenate([part.sides for part in parts]),
            np.concatenate([part.weights for part in parts]),
        )


def _held(data: LabelledVectors, name: SplitName, training: TrainingSettings) -> Held:
    return hold_out(data.groups, name, training.test_fraction, training.seed)


def _patches(data: LabelledVectors, chosen: Held) -> Lesson:
    """Return the chosen patches without views."""
    return lesson_of(replace(data, views=None), chosen)


def _error(regression: BoxRegression, tried: _Told) -> BoxError | None:
    if not len(tried.sides):
        return None
    misses = abs(regression.sides(tried.hogs) - tried.sides)
    return BoxError(len(tried.sides), round(float(np.nanmean(misses)), 4))
