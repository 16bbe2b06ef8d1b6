"""Where a vehicle's sides are, from the HOG of a window around it: linear ridge regression."""

from collections.abc import Callable, Sequence

import numpy as np
from sklearn.linear_model import Ridge

from vdet.boxes import BoolArray, Float32Array
from vdet.config.svm import FeatureSettings
from vdet.detect.svm.model import BoxRegression
from vdet.learn.svm.extraction import LabelledVectors

PENALTY = 1.0
"""Ridge penalty of the weights of scaled features, for each row."""

_LEAST_SPREAD = 0.05
"""Added to each feature's spread, share of the mean spread: limits the weights of features that
hardly vary."""


def fit_boxes(
    sets: Sequence[LabelledVectors],
    hold_out: Callable[[LabelledVectors], BoolArray],
    features: FeatureSettings,
) -> tuple[BoxRegression | None, float | None]:
    """Fit on the patches that are not held out and measure the error on the others.

    Parameters
    ----------
    sets
        Patches of which some have known sides.
    hold_out
        Returns which patches of a set are held out, bool `(patches,)`.

    Returns
    -------
    The regression, and the mean absolute error on the known sides of patches that are held out, as
    a share of the patch's side. Either is None if it has no patches.
    """
    length = features.hog_length
    learnt, tested = [], []
    for data in sets:
        has_sides = np.isfinite(data.sides[data.patches]).any(axis=1)
        held = hold_out(data)
        learnt.append(data.of(has_sides & ~held))
        tested.append(data.patches[has_sides & held])
    sides = np.concatenate([each.sides for each in learnt])
    if not len(sides):
        return None, None
    regression = fit_sides(np.concatenate([each.vectors[:, :length] for each in learnt]), sides)
    errors = [
        abs(regression.sides(data.vectors[rows, :length]) - data.sides[rows])
        for data, rows in zip(sets, tested, strict=True)
    ]
    together = np.concatenate(errors)
    return regression, round(float(np.nanmean(together)), 4) if len(together) else None


def fit_sides(hogs: Float32Array, sides: Float32Array) -> BoxRegression:
    """Fit the sides of vehicles' boxes to HOG vectors; a side that is never known is always 0.

    Parameters
    ----------
    hogs
        float32 `(n, h)`; they are overwritten, which saves memory.
    sides
        float32 `(n, 4)`: left, top, right, bottom from the window's centre, in widths and heights
        of the window; NaN for unknown ones.
    """
    spread = hogs.std(axis=0)
    spread += _LEAST_SPREAD * spread.mean() + np.finfo(np.float32).tiny
    hogs /= spread
    weights = np.zeros((4, hogs.shape[1]), np.float32)
    biases = np.zeros(4, np.float32)
    for side in range(4):
        known = ~np.isnan(sides[:, side])
        if known.any():
            ridge = Ridge(PENALTY * np.count_nonzero(known), copy_X=False)
            ridge.fit(hogs[known], sides[known, side])
            weights[side] = ridge.coef_ / spread
            biases[side] = ridge.intercept_
    return BoxRegression(weights, biases)
