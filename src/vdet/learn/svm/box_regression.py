"""Where a vehicle's sides are, from the HOG of a window around it: linear ridge regression."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vdet.boxes import BoolArray, Float32Array, Float64Array
from vdet.config.schema import Settings, SvmTrainingSettings
from vdet.detect.svm.features import Layout
from vdet.detect.svm.model import BoxRegression
from vdet.learn.svm.augmentation import Augmenter, augment, zoom_in
from vdet.learn.svm.dataset import PatchFile, Sides
from vdet.learn.svm.extraction import LabelledVectors, SampleVectors, extract
from vdet.learn.svm.metrics import BoxError
from vdet.learn.svm.training_set import SplitName, hold_out, training_set
from vdet.progress import Steps, no_steps
from vdet.workers import Workers

_ASSUMED_SIDES: Sides = (-0.47, -0.40, 0.47, 0.42)
"""Typical sides of the vehicle in a patch of the Udacity set."""

_LEAST_SPREAD = 0.05
"""Added to each feature's spread, share of the mean spread: limits the weights of features that
hardly vary."""

_BLOCK = 1024
"""Rows that are scaled at a time."""


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
            max_broken=training.max_broken,
            augmenter=augmenter,
            seed=training.seed,
            workers=workers,
            progress=steps(step, len(some)),
        )

    without_parts = training.augmentation.model_copy(update={"parts": 0.0})  # parts have no box
    augmenter = partial(augment, settings=without_parts)
    assumed = [
        replace(file, sides=_ASSUMED_SIDES)
        for file in files
        if file.vehicle and file.source not in with_boxes and training.boxes.assumed
    ]
    return BoxPatches(
        describe(boxed, augmenter, "describing patches with boxes") if boxed else None,
        describe(assumed, zoom_in, "describing vehicles again") if assumed else None,
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
        parts.append((patches.boxed, _hold_out(patches.boxed, name, settings.train.svm)))
    assumed = None
    if patches.assumed is not None:
        assumed_held = _hold_out(patches.assumed, name, settings.train.svm)
        assumed = training_set(patches.assumed, ~assumed_held)
    regression = fit_boxes([_with_sides(each, ~out) for each, out in parts], assumed, settings)
    if regression is None:
        return None, None
    tested = [_with_sides(replace(each, augmented=None), out) for each, out in parts]
    return regression, _error(regression, tested, settings)


def fit_boxes(
    sets: Sequence[SampleVectors], assumed: SampleVectors | None, settings: Settings
) -> BoxRegression | None:
    """Fit on samples with known sides and, with less weight, on samples with assumed sides.

    Returns None if no side is known.
    """
    boxes = settings.train.svm.boxes
    length = Layout.of(settings.svm.features).hog_length
    rows = [BoxRows(each.vectors[:, :length], each.sides) for each in sets]
    count = sum(int(np.isfinite(each.sides).any(axis=1).sum()) for each in sets)
    if not count:
        return None
    if assumed is not None:
        weight = boxes.assumed * count / len(assumed.sides)
        rows.append(BoxRows(assumed.vectors[:, :length], assumed.sides, weight))
    return fit_sides(rows, boxes.penalty)


def _with_sides(data: LabelledVectors, kept: BoolArray) -> SampleVectors:
    """Return the training set of the kept patches of which at least one side is known."""
    if data.sides is not None:
        kept = kept & np.isfinite(data.sides).any(axis=1)
    return training_set(data, kept)


def _hold_out(data: LabelledVectors, name: SplitName, training: SvmTrainingSettings) -> BoolArray:
    return hold_out(data.groups, name, training.test_fraction, training.seed)


def _error(
    regression: BoxRegression, tested: Sequence[SampleVectors], settings: Settings
) -> BoxError | None:
    length = Layout.of(settings.svm.features).hog_length
    errors = np.concatenate(
        [abs(regression.sides(each.vectors[:, :length]) - each.sides) for each in tested]
    )
    return BoxError(len(errors), round(float(np.nanmean(errors)), 4)) if len(errors) else None


@dataclass(frozen=True, slots=True, eq=False)
class BoxRows:
    """Rows to fit the sides of boxes to, all of the same weight.

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
    for columns, rows in _patterns([~np.isnan(part.sides) for part in parts]):
        slopes[columns], biases[columns] = _Ridge(parts, columns, rows).solve(penalty)
    return BoxRegression(slopes, biases)


_Pattern = tuple[list[int], list[BoolArray]]


def _patterns(known: Sequence[BoolArray]) -> Iterator[_Pattern]:
    """Yield the columns known in the same rows, and these rows of each part."""
    together = np.concatenate(known)
    left = [column for column in range(together.shape[1]) if together[:, column].any()]
    while left:
        first = left[0]
        columns = [column for column in left if (together[:, column] == together[:, first]).all()]
        yield columns, [part[:, first] for part in known]
        left = [column for column in left if column not in columns]


class _Ridge:
    """Ridge regression by the normal equations of scaled features."""

    def __init__(
        self, parts: Sequence[BoxRows], columns: Sequence[int], rows: Sequence[BoolArray]
    ) -> None:
        self._parts, self._columns, self._rows = parts, list(columns), rows
        self._count, self._weight = 0, 0.0
        width = parts[0].hogs.shape[1]
        sums, squares, weighted = np.zeros((3, width))
        targets = np.zeros(len(self._columns))
        for hogs, sides, weight in self._blocks():
            self._count += len(hogs)
            self._weight += weight * len(hogs)
            total = hogs.sum(axis=0, dtype=np.float64)
            sums += total
            weighted += weight * total
            squares += np.square(hogs, dtype=np.float64).sum(axis=0)
            targets += weight * sides.sum(axis=0, dtype=np.float64)
        mean = sums / self._count
        spread = np.sqrt(np.maximum(squares / self._count - np.square(mean), 0))
        self._spread = spread + _LEAST_SPREAD * spread.mean() + np.finfo(np.float32).tiny
        self._mean = weighted / self._weight
        self._target = targets / self._weight

    def _blocks(self) -> Iterator[tuple[Float32Array, Float32Array, float]]:
        """Yield HOG and targets of the rows, block by block, with their weight."""
        for part, known in zip(self._parts, self._rows, strict=True):
            (rows,) = np.nonzero(known)
            for start in range(0, len(rows), _BLOCK):
                some = rows[start : start + _BLOCK]
                yield part.hogs[some], part.sides[some][:, self._columns], part.weight

    def solve(self, penalty: float) -> tuple[Float64Array, Float64Array]:
        """Return weights `(columns, h)` and biases `(columns,)` for features as they are."""
        from scipy.linalg import solve  # type: ignore[import-untyped]

        ridge = penalty * self._weight
        if self._count < len(self._mean):  # the products of the rows are fewer
            blocks = list(self._scaled())
            hogs, sides = (np.concatenate(each) for each in zip(*blocks, strict=True))
            products = (hogs @ hogs.T).astype(np.float64) + ridge * np.identity(self._count)
            scaled = hogs.T @ solve(products, sides, assume_a="pos", overwrite_a=True)
        else:
            gram = np.diag(np.full(len(self._mean), ridge))
            product = np.zeros((len(self._mean), len(self._columns)))
            for hogs, sides in self._scaled():
                gram += hogs.T @ hogs
                product += hogs.T @ sides
            scaled = solve(gram, product, assume_a="pos", overwrite_a=True)
        weights = scaled.T / self._spread
        return weights, self._target - weights @ self._mean

    def _scaled(self) -> Iterator[tuple[Float32Array, Float64Array]]:
        """Yield the rows block by block, both centred, the HOG scaled too."""
        for hogs, sides, weight in self._blocks():
            scaled = (hogs - self._mean) / self._spread * weight**0.5
            yield scaled.astype(np.float32), (sides - self._target) * weight**0.5
