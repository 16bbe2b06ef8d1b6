"""Where a vehicle's sides are, from the HOG of a window around it: linear ridge regression."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vdet.boxes import BoolArray, Float32Array
from vdet.config.schema import Settings
from vdet.detect.svm.features import Layout
from vdet.detect.svm.model import BoxRegression
from vdet.learn.svm.augmentation import augment, zoom_in
from vdet.learn.svm.dataset import PatchFile, Sides
from vdet.learn.svm.extraction import LabelledVectors, extract
from vdet.progress import Steps, no_steps
from vdet.workers import Workers

_ASSUMED_SIDES: Sides = (-0.47, -0.40, 0.47, 0.42)
"""Typical sides of the vehicle in a patch of the Udacity set."""

ASSUMED = 0.5
"""Weight of vehicle patches from sources without boxes, relative to patches with boxes."""

PENALTY = 1.0
"""Ridge penalty of the weights of scaled features, for each row of weight 1."""

_LEAST_SPREAD = 0.05
"""Added to each feature's spread, share of the mean spread: limits the weights of features that
hardly vary."""


@dataclass(frozen=True, slots=True, eq=False)
class BoxPatches:
    """Patches that only the regression uses.

    `boxed` are patches of neither class, with known sides. `assumed` are the vehicles from sources
    without boxes, with `_ASSUMED_SIDES`.
    """

    boxed: LabelledVectors
    assumed: LabelledVectors


def extract_box_patches(
    files: Sequence[PatchFile],
    boxed: Sequence[PatchFile],
    settings: Settings,
    *,
    workers: Workers,
    steps: Steps = no_steps,
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
    training = settings.train.svm
    describe = partial(extract, features=settings.svm.features, training=training, workers=workers)
    without_parts = training.augmentation.model_copy(update={"parts": 0.0})  # parts have no box
    assumed = [
        replace(file, sides=_ASSUMED_SIDES)
        for file in files
        if file.vehicle and file.source not in with_boxes
    ]
    augmenter = partial(augment, settings=without_parts)
    progress = steps("describing patches with boxes", len(boxed))
    of_boxed = describe(boxed, augmenter=augmenter, progress=progress)
    progress = steps("describing vehicles again", len(assumed))
    return BoxPatches(of_boxed, describe(assumed, augmenter=zoom_in, progress=progress))


def fit_split_boxes(
    data: LabelledVectors,
    patches: BoxPatches,
    hold_out: Callable[[LabelledVectors], BoolArray],
    settings: Settings,
) -> tuple[BoxRegression | None, float | None]:
    """Fit on the patches that are not held out and measure the error on the others.

    Parameters
    ----------
    hold_out
        Returns which patches of a set are held out, bool `(patches,)`.

    Returns
    -------
    The regression, and the mean absolute error on the known sides of patches that are held out, as
    a share of the patch's side. Either is None if it has no patches.
    """
    length = Layout.of(settings.svm.features).hog_length
    rows = _training_rows(data, patches, hold_out, length)
    if rows is None:
        return None, None
    regression = fit_sides(*rows)
    errors = []
    for each in (data, patches.boxed):
        tested = _with_sides(each, hold_out(each))
        patch_rows = tested.patches
        found = regression.sides(tested.vectors[patch_rows, :length])
        errors.append(abs(found - tested.sides[patch_rows]))
    together = np.concatenate(errors)
    return regression, round(float(np.nanmean(together)), 4) if len(together) else None


def _training_rows(
    data: LabelledVectors,
    patches: BoxPatches,
    hold_out: Callable[[LabelledVectors], BoolArray],
    length: int,
) -> tuple[Float32Array, Float32Array, Float32Array] | None:
    """Return HOG, sides and weights of the rows to fit to; None where no side is known."""
    sets = [_with_sides(each, ~hold_out(each)) for each in (data, patches.boxed)]
    weights = [np.ones(len(each.sides), np.float32) for each in sets]
    known = sum(map(len, weights))
    if not known:
        return None
    if patches.assumed.files:
        sets.append(patches.assumed.of(~hold_out(patches.assumed)))
        count = len(sets[-1].sides)
        weights.append(np.full(count, ASSUMED * known / count, np.float32))
    hogs = np.concatenate([each.vectors[:, :length] for each in sets])
    return hogs, np.concatenate([each.sides for each in sets]), np.concatenate(weights)


def _with_sides(data: LabelledVectors, kept: BoolArray) -> LabelledVectors:
    """Return the kept patches of which at least one side is known."""
    return data.of(kept & np.isfinite(data.sides[data.patches]).any(axis=1))


def fit_sides(hogs: Float32Array, sides: Float32Array, weights: Float32Array) -> BoxRegression:
    """Fit the sides of vehicles' boxes to HOG vectors; a side that is never known is always 0.

    Parameters
    ----------
    hogs
        float32 `(n, h)`; they are overwritten, which saves memory.
    sides
        float32 `(n, 4)`: left, top, right, bottom from the window's centre, in widths and heights
        of the window; NaN for unknown ones.
    weights
        How much each row counts, float32 `(n,)`.
    """
    from sklearn.linear_model import Ridge

    spread = hogs.std(axis=0)
    spread += _LEAST_SPREAD * spread.mean() + np.finfo(np.float32).tiny
    hogs /= spread
    slopes = np.zeros((4, hogs.shape[1]), np.float32)
    biases = np.zeros(4, np.float32)
    for side in range(4):
        known = ~np.isnan(sides[:, side])
        if known.any():  # centred and weighted here, because Ridge copies the rows for each
            rows, weight, targets = hogs[known], weights[known], sides[known, side]
            mean, middle = weight @ rows / weight.sum(), weight @ targets / weight.sum()
            root = np.sqrt(weight)
            rows -= mean
            rows *= root[:, np.newaxis]
            ridge = Ridge(PENALTY * float(weight.sum()), fit_intercept=False, copy_X=False)
            ridge.fit(rows, (targets - middle) * root)
            slopes[side] = ridge.coef_ / spread
            biases[side] = middle - ridge.coef_ @ mean
    return BoxRegression(slopes, biases)
