"""Where a vehicle's sides are, from the HOG of a window around it: linear ridge regression."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vdet.config.schema import Settings, TrainingSettings
from vdet.detect.svm.features import Layout
from vdet.detect.svm.model import BoxRegression
from vdet.geometry import BoolArray, Float32Array
from vdet.learn.augmentation import augment, zoom_in
from vdet.learn.dataset import PatchFile, Sides
from vdet.learn.extraction import LabelledVectors, SampleVectors, extract
from vdet.learn.report import BoxError
from vdet.learn.training_set import SplitName, hold_out, training_set
from vdet.workers import Workers

_ASSUMED_SIDES: Sides = (-0.47, -0.40, 0.47, 0.42)
"""Typical sides of the vehicle in a patch of the Udacity set."""

_LEAST_SPREAD = 0.05
"""Added to each feature's spread, share of the mean spread: keeps weights of rare changes small."""


@dataclass(frozen=True, slots=True, eq=False)
class BoxPatches:
    """Patches that only the regression uses; None if there are none.

    `boxed` are patches of neither class, with known sides. `assumed` are the vehicles from sources
    without boxes, with `_ASSUMED_SIDES`.
    """

    boxed: LabelledVectors | None
    assumed: LabelledVectors | None


def extract_box_patches(
    files: Sequence[PatchFile],
    boxed: Sequence[PatchFile],
    settings: Settings,
    *,
    workers: Workers,
    progress: Callable[[int], object],
) -> BoxPatches | None:
    """Describe the patches that the regression uses besides `files`.

    Returns
    -------
    None if there is nothing to fit: no patch has a known side, or there is no HOG among the
    features.

    Raises
    ------
    DataError
        Too many patches are unreadable.
    """
    with_boxes = {file.source for file in (*files, *boxed) if file.sides}
    if not with_boxes or not settings.svm.features.hog.channels:
        return None
    training = settings.training
    describe = partial(
        extract,
        settings=settings.svm.features,
        max_broken=training.max_broken,
        seed=training.seed,
        workers=workers,
    )
    without_parts = training.augmentation.model_copy(update={"parts": 0.0})  # parts have no box
    augmenter = partial(augment, settings=without_parts)
    assumed = [
        replace(file, sides=_ASSUMED_SIDES)
        for file in files
        if file.vehicle and file.source not in with_boxes and training.boxes.assumed
    ]
    return BoxPatches(
        describe(boxed, augmenter=augmenter, progress=progress) if boxed else None,
        describe(assumed, augmenter=zoom_in) if assumed else None,
    )


def fit_split_boxes(
    data: LabelledVectors,
    held: BoolArray,
    patches: BoxPatches,
    name: SplitName,
    settings: Settings,
) -> tuple[BoxRegression | None, BoxError | None]:
    """Fit on the patches that are not held out and measure the error on the others.

    Parameters
    ----------
    held
        bool `(n,)`: the held-out patches of `data`. Of `patches` the same split is made.

    Returns
    -------
    Either is None if it has no patches.
    """
    parts = [(data, held)]
    if patches.boxed is not None:
        parts.append((patches.boxed, _hold_out(patches.boxed, name, settings.training)))
    assumed = None
    if patches.assumed is not None:
        assumed_held = _hold_out(patches.assumed, name, settings.training)
        assumed = training_set(patches.assumed, ~assumed_held)
    regression = fit_boxes([training_set(each, ~out) for each, out in parts], assumed, settings)
    if regression is None:
        return None, None
    tested = [training_set(replace(each, augmented=None), out) for each, out in parts]
    return regression, _error(regression, _BoxRows.of(tested, settings))


def fit_boxes(
    sets: Sequence[SampleVectors], assumed: SampleVectors | None, settings: Settings
) -> BoxRegression | None:
    """Fit on samples with known sides and, with less weight, on samples with assumed sides.

    Returns None if no side is known.
    """
    training = settings.training
    rows = _BoxRows.of(sets, settings)
    count = len(rows.sides)
    if not count:
        return None
    weights = np.ones(count, np.float32)
    if assumed is not None:
        further = _BoxRows.of([assumed], settings)
        weight = training.boxes.assumed * count / len(assumed.sides)
        weights = np.append(weights, np.full(len(further.sides), weight, np.float32))
        rows = _BoxRows(
            np.concatenate([rows.hogs, further.hogs]), np.concatenate([rows.sides, further.sides])
        )
    return fit_sides(rows.hogs, rows.sides, training.boxes.penalty, weights)


@dataclass(frozen=True, slots=True, eq=False)
class _BoxRows:
    """Samples of which at least one side is known: HOG `(n, h)` and sides `(n, 4)`."""

    hogs: Float32Array
    sides: Float32Array

    @staticmethod
    def of(sets: Sequence[SampleVectors], settings: Settings) -> "_BoxRows":
        length = Layout.of(settings.svm.features).hog_length
        known = [np.isfinite(each.sides).any(axis=1) for each in sets]
        return _BoxRows(
            np.concatenate([s.vectors[rows, :length] for s, rows in zip(sets, known, strict=True)]),
            np.concatenate([s.sides[rows] for s, rows in zip(sets, known, strict=True)]),
        )


def _hold_out(data: LabelledVectors, name: SplitName, training: TrainingSettings) -> BoolArray:
    return hold_out(data.groups, name, training.test_fraction, training.seed)


def _error(regression: BoxRegression, tested: _BoxRows) -> BoxError | None:
    if not len(tested.sides):
        return None
    errors = abs(regression.sides(tested.hogs) - tested.sides)
    return BoxError(len(tested.sides), round(float(np.nanmean(errors)), 4))


def fit_sides(
    hogs: Float32Array, sides: Float32Array, penalty: float, weights: Float32Array | None = None
) -> BoxRegression:
    """Fit the sides of vehicles' boxes to HOG vectors.

    Parameters
    ----------
    hogs
        float32 `(n, h)`.
    sides
        float32 `(n, 4)`: left, top, right, bottom from the window's centre, in widths and heights
        of the window; NaN for unknown ones. A side without any known value is always 0.
    penalty
        Ridge penalty of the weights of scaled features, for each patch.
    weights
        float32 `(n,)`: weight of each row; None for equal weights.
    """
    if weights is None:
        weights = np.ones(len(hogs), np.float32)
    slopes = np.zeros((4, hogs.shape[1]), np.float32)
    biases = np.zeros(4, np.float32)
    for columns, rows in _patterns(~np.isnan(sides)):
        targets = sides[rows][:, columns]
        slopes[columns], biases[columns] = _ridge(hogs[rows], targets, penalty, weights[rows])
    return BoxRegression(slopes, biases)


def _patterns(known: BoolArray) -> Iterator[tuple[list[int], BoolArray]]:
    """Yield the columns known in the same rows, and these rows: they are solved together."""
    left = [column for column in range(known.shape[1]) if known[:, column].any()]
    while left:
        rows = known[:, left[0]]
        columns = [column for column in left if (known[:, column] == rows).all()]
        yield columns, rows
        left = [column for column in left if column not in columns]


def _ridge(
    hogs: Float32Array, targets: Float32Array, penalty: float, weights: Float32Array
) -> tuple[Float32Array, Float32Array]:
    from sklearn.linear_model import Ridge

    spread = hogs.std(axis=0)
    spread += _LEAST_SPREAD * spread.mean() + np.finfo(np.float32).tiny
    alpha = penalty * float(weights.sum())
    ridge = Ridge(alpha=alpha, solver="cholesky").fit(hogs / spread, targets, weights)
    return ridge.coef_ / spread, ridge.intercept_
