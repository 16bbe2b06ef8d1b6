"""Where a vehicle's sides are, from the HOG of a window around it: linear ridge regression."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vdet.boxes import BoolArray, Float32Array, Float64Array
from vdet.config.schema import Settings
from vdet.detect.svm.features import Layout
from vdet.detect.svm.model import BoxRegression
from vdet.learn.svm.augmentation import Augmenter, augment, zoom_in
from vdet.learn.svm.dataset import PatchFile, Sides
from vdet.learn.svm.extraction import LabelledVectors, extract
from vdet.progress import Steps, no_steps
from vdet.workers import Workers

_ASSUMED_SIDES: Sides = (-0.47, -0.40, 0.47, 0.42)
"""Typical sides of the vehicle in a patch of the Udacity set."""

ASSUMED = 0.5
"""Weight of vehicle patches from sources without boxes, relative to patches with boxes."""

PENALTY = 1.0
"""Ridge penalty of the weights of scaled features, for each patch."""

_LEAST_SPREAD = 0.05
"""Added to each feature's spread, share of the mean spread: limits the weights of features that
hardly vary."""

_BLOCK = 1024
"""Rows that are scaled at a time."""


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

    def describe(some: Sequence[PatchFile], augmenter: Augmenter, step: str) -> LabelledVectors:
        return extract(
            some,
            settings.svm.features,
            training,
            augmenter=augmenter,
            workers=workers,
            progress=(steps if some else no_steps)(step, len(some)),
        )

    without_parts = training.augmentation.model_copy(update={"parts": 0.0})  # parts have no box
    assumed = [
        replace(file, sides=_ASSUMED_SIDES)
        for file in files
        if file.vehicle and file.source not in with_boxes
    ]
    augmenter = partial(augment, settings=without_parts)
    return BoxPatches(
        describe(boxed, augmenter, "describing patches with boxes"),
        describe(assumed, zoom_in, "describing vehicles again"),
    )


def fit_split_boxes(
    data: LabelledVectors,
    patches: BoxPatches,
    hold_out: Callable[[LabelledVectors], BoolArray],
    settings: Settings,
) -> tuple[BoxRegression | None, float | None]:
    """Fit on the patches that are not held out and measure the error on the others.

    Samples with assumed sides have less weight.

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
    sets = data, patches.boxed
    learnt = [_with_sides(each, ~hold_out(each)) for each in sets]
    count = sum(int(np.isfinite(each.sides).any(axis=1).sum()) for each in learnt)
    if not count:
        return None, None
    rows = [BoxRows(each.vectors[:, :length], each.sides) for each in learnt]
    if patches.assumed.files:
        assumed = patches.assumed.of(~hold_out(patches.assumed))
        weight = ASSUMED * count / len(assumed.sides)
        rows.append(BoxRows(assumed.vectors[:, :length], assumed.sides, weight))
    regression = fit_sides(rows, PENALTY)
    errors = []
    for each in sets:
        tested = _with_sides(each, hold_out(each))
        hogs = tested.vectors[: len(tested.files), :length]
        errors.append(abs(regression.sides(hogs) - tested.sides[: len(hogs)]))
    together = np.concatenate(errors)
    return regression, round(float(np.nanmean(together)), 4) if len(together) else None


def _with_sides(data: LabelledVectors, kept: BoolArray) -> LabelledVectors:
    """Return the kept patches of which at least one side is known."""
    return data.of(kept & np.isfinite(data.sides[: len(kept)]).any(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class BoxRows:
    """Rows to fit the sides of boxes to.

    Attributes
    ----------
    hogs
        float32 `(n, h)`.
    sides
        float32 `(n, 4)`: left, top, right, bottom from the window's centre, in widths and heights
        of the window; NaN for unknown ones.
    weight
        How much each row counts.
    """

    hogs: Float32Array
    sides: Float32Array
    weight: float = 1.0


def fit_sides(parts: Sequence[BoxRows], penalty: float) -> BoxRegression:
    """Fit the sides of vehicles' boxes to HOG vectors; a side that is never known is always 0.

    The rows are taken in blocks, so that they are not copied as a whole.

    Parameters
    ----------
    penalty
        Ridge penalty of the weights of scaled features, for each row of weight 1.
    """
    slopes = np.zeros((4, parts[0].hogs.shape[1]), np.float32)
    biases = np.zeros(4, np.float32)
    known = ~np.isnan(np.concatenate([part.sides for part in parts]))
    for pattern in np.unique(known[:, known.any(axis=0)], axis=1).T:
        columns = np.flatnonzero((known == pattern[:, np.newaxis]).all(axis=0)).tolist()
        slopes[columns], biases[columns] = _fit_columns(parts, columns, penalty)
    return BoxRegression(slopes, biases)


def _fit_columns(
    parts: Sequence[BoxRows], columns: Sequence[int], penalty: float
) -> tuple[Float64Array, Float64Array]:
    """Fit sides that are known in the same rows, by the normal equations of scaled features.

    Returns
    -------
    Weights `(columns, h)` and biases `(columns,)` for features as they are.
    """
    from scipy.linalg import solve  # type: ignore[import-untyped]
    from sklearn.preprocessing import StandardScaler

    features, weighted = StandardScaler(), StandardScaler()
    for block in _blocks(parts, columns):
        features.partial_fit(block.hogs)
        weights = np.full(len(block.hogs), block.weight)
        weighted.partial_fit(np.hstack([block.hogs, block.sides]), sample_weight=weights)
    width = parts[0].hogs.shape[1]
    mean, target = np.split(weighted.mean_, [width])
    spread = np.sqrt(features.var_)
    spread += _LEAST_SPREAD * spread.mean() + np.finfo(np.float32).tiny

    def scaled() -> Iterator[tuple[Float32Array, Float64Array]]:
        """Yield the rows block by block, both centred, the HOG scaled too."""
        for block in _blocks(parts, columns):
            root = block.weight**0.5
            hogs = (block.hogs - mean) / spread * root
            yield hogs.astype(np.float32), (block.sides - target) * root

    ridge = penalty * float(np.max(weighted.n_samples_seen_))
    count = int(np.max(features.n_samples_seen_))
    if count < width:  # the products of the rows are fewer
        hogs, sides = (np.concatenate(each) for each in zip(*scaled(), strict=True))
        products = (hogs @ hogs.T).astype(np.float64) + ridge * np.identity(count)
        found = hogs.T @ solve(products, sides, assume_a="pos", overwrite_a=True)
    else:
        gram = ridge * np.identity(width)
        product = np.zeros((width, len(columns)))
        for hogs, sides in scaled():
            gram += hogs.T @ hogs
            product += hogs.T @ sides
        found = solve(gram, product, assume_a="pos", overwrite_a=True)
    slopes = found.T / spread
    return slopes, target - slopes @ mean


def _blocks(parts: Sequence[BoxRows], columns: Sequence[int]) -> Iterator[BoxRows]:
    """Yield the rows in which these sides are known, block by block, with these sides only."""
    for part in parts:
        rows = np.flatnonzero(~np.isnan(part.sides[:, columns[0]]))
        for start in range(0, len(rows), _BLOCK):
            some = rows[start : start + _BLOCK]
            yield BoxRows(part.hogs[some], part.sides[some][:, columns], part.weight)
