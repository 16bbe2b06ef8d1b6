"""Fit a `LinearModel` to patch files, and measure it.

The features are scaled, and the scores are calibrated. The classifier is the same as `LinearSVC` of
scikit-learn: squared hinge loss, L2 penalty on weights and bias. liblinear, used by `LinearSVC`,
copies float32 data to six times their size; L-BFGS needs only products of the data with a vector.

Sources: for the solver, Liu and Nocedal, "On the Limited Memory BFGS Method for Large Scale
Optimization", 1989; for the calibration, Platt, "Probabilistic outputs for support vector
machines", 1999.
"""

import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Self

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize
from sklearn.linear_model import LogisticRegression, Ridge
from sklearn.model_selection import StratifiedKFold
from sklearn.preprocessing import StandardScaler

from vdet.boxes import BoolArray, Float32Array, Float64Array
from vdet.config.schema import Settings
from vdet.detect.svm.model import BoxRegression, LinearModel
from vdet.errors import DataError
from vdet.evaluate.results import figure, table
from vdet.learn.svm.patches import LabelledVectors, PatchFile, extract, hold_out
from vdet.version import __version__
from vdet.workers import Progress, no_progress

log = logging.getLogger("vdet")

FOLDS = 3
"""Number of cross-validation folds for the calibration."""
MAX_ITERATIONS = 1000
"""Maximum number of iterations of the solver."""
PENALTY = 1.0
"""Ridge penalty per row on the weights of scaled features for the sides."""

_SMALL_SPREAD = 0.05
"""Added to the spread of each feature, as a fraction of the mean spread: limits the weights of
features that hardly vary."""

_BLOCK = 1024  # rows that are scaled at a time
_CORRECTIONS = 20  # of L-BFGS
_TOLERANCE = 1e-9  # of the loss, relative to that of zero weights

THRESHOLD = 0.5
"""A patch with at least this probability is classified as a vehicle."""


def fit(rows: LabelledVectors, settings: Settings) -> LinearModel:
    """Scale the features, fit a linear SVM, and calibrate it by a sigmoid.

    The sigmoid is fitted only to patches, each scored by an SVM fitted without it and its samples.
    The scaling becomes part of the weights.

    Parameters
    ----------
    rows
        Their vectors are overwritten, which saves memory.

    Raises
    ------
    DataError
        A class has fewer patches than there are calibration folds.
    """
    penalty, labels = settings.train.svm.C, rows.labels
    fewest = min(np.count_nonzero(labels), np.count_nonzero(~labels))
    if fewest < FOLDS:
        raise DataError(
            f"a class has {fewest} training patches, must be at least {FOLDS}; add more"
        )
    scaler = StandardScaler(copy=False)
    for start in range(0, len(rows.vectors), _BLOCK):  # as a whole, it needs twice their memory
        scaler.partial_fit(rows.vectors[start : start + _BLOCK])
    vectors, patches = scaler.transform(rows.vectors), rows.patches
    scores = np.zeros(len(labels))
    for _, tested in StratifiedKFold(FOLDS, shuffle=True, random_state=0).split(labels, labels):
        part = _fit_svm(vectors, rows.vehicle, ~np.isin(rows.origins, tested), penalty)
        scores[tested] = vectors[patches[tested]] @ part[:-1].astype(np.float32) + part[-1]
    svm = _fit_svm(vectors, rows.vehicle, np.ones(len(vectors), bool), penalty)
    # w·(x - μ)/σ + b = (w/σ)·x + (b - (w/σ)·μ)
    weights = svm[:-1] / scaler.scale_
    bias = svm[-1] - weights @ scaler.mean_
    slope, offset = _fit_sigmoid(scores, labels)
    biases, slopes, offsets = np.array([[bias], [slope], [offset]], np.float32)
    normal = weights[np.newaxis].astype(np.float32)
    return LinearModel(settings.svm.features, normal, biases, slopes, offsets)


def _fit_svm(
    vectors: Float32Array, vehicle: BoolArray, used: BoolArray, penalty: float
) -> Float64Array:
    """Fit a linear SVM to the used rows; return the weights, and the bias last."""
    # The products include all vectors, because a copy of some would double their memory.
    signs = np.where(vehicle, used, -1.0 * used).astype(np.float32)
    scale = 1 / (penalty * np.count_nonzero(used))  # the loss of zero weights becomes 1

    def loss(parameters: Float64Array) -> tuple[float, Float64Array]:
        weights, bias = parameters[:-1].astype(np.float32), np.float32(parameters[-1])
        errors = np.maximum(0, used - signs * (vectors @ weights + bias))
        slopes = -2 * penalty * (errors * signs)
        gradient = parameters + np.append(slopes @ vectors, slopes.sum())
        squares = float(np.square(errors, dtype=np.float64).sum())
        value = 0.5 * float(parameters @ parameters) + penalty * squares
        return scale * value, scale * gradient

    limits = {"maxiter": MAX_ITERATIONS, "maxfun": 10 * MAX_ITERATIONS}
    options = {**limits, "maxcor": _CORRECTIONS, "ftol": _TOLERANCE, "gtol": 0}
    zeros = np.zeros(vectors.shape[1] + 1)
    solution = minimize(loss, zeros, jac=True, method="L-BFGS-B", options=options)
    if solution.status == 1:  # the iterations are used up
        log.warning("the SVM has not converged; lower train.svm.C")
    return np.asarray(solution.x)


def _fit_sigmoid(scores: Float64Array, vehicle: BoolArray) -> tuple[float, float]:
    """Return slope and offset of the sigmoid 1 / (1 + exp(slope · score + offset)).

    The targets are those of Platt: not quite 1 and 0, depending on the number of patches.
    """
    positives, negatives = np.count_nonzero(vehicle), np.count_nonzero(~vehicle)
    targets = np.where(vehicle, (positives + 1) / (positives + 2), 1 / (negatives + 2))
    values, signs = np.tile(scores, 2)[:, np.newaxis], np.repeat([True, False], len(scores))
    weights = np.concatenate([targets, 1 - targets])
    sigmoid = LogisticRegression(C=np.inf, tol=1e-8).fit(values, signs, weights)
    return -sigmoid.coef_[0, 0], -sigmoid.intercept_[0]


def fit_boxes(
    data: LabelledVectors, held: BoolArray, hog_length: int
) -> tuple[BoxRegression | None, float | None]:
    """Fit on the patches that are not held out, and measure the error on the others.

    Parameters
    ----------
    data
        Patches, some of them with known sides.
    held
        Which patches are held out, bool `(patches,)`.
    hog_length
        Number of features of HOG, which come first.

    Returns
    -------
    The regression, and the mean absolute error on the known sides of held-out patches, as a
    fraction of the patch's side. Either is None if there are no such patches.
    """
    has_sides: BoolArray = np.asarray(np.isfinite(data.sides).any(axis=1))
    learnt = has_sides & ~held[data.origins]
    tested = data.patches[held & has_sides[data.patches]]
    if not learnt.any():
        return None, None
    regression = fit_sides(data.vectors[learnt, :hog_length], data.sides[learnt])
    errors = abs(regression.sides(data.vectors[tested, :hog_length]) - data.sides[tested])
    return regression, round(float(np.nanmean(errors)), 4) if len(tested) else None


def fit_sides(hogs: Float32Array, sides: Float32Array) -> BoxRegression:
    """Fit the sides of vehicles to HOG vectors; a side that is never known is predicted as 0.

    Parameters
    ----------
    hogs
        float32 `(n, h)`; they are overwritten, which saves memory.
    sides
        float32 `(n, 4)`: left, top, right, bottom from the window's centre, in widths and heights
        of the window; NaN for unknown ones.
    """
    spread = hogs.std(axis=0)
    spread += _SMALL_SPREAD * spread.mean() + np.finfo(np.float32).tiny
    hogs /= spread
    weights = np.zeros((4, hogs.shape[1]), np.float32)
    biases = np.zeros(4, np.float32)
    for side in range(4):
        has_side = ~np.isnan(sides[:, side])
        if has_side.any():
            ridge = Ridge(PENALTY * np.count_nonzero(has_side), copy_X=False)
            ridge.fit(hogs[has_side], sides[has_side, side])
            weights[side] = ridge.coef_ / spread
            biases[side] = ridge.intercept_
    return BoxRegression(weights, biases)


@dataclass(frozen=True, slots=True)
class Classification:
    """Patches by truth and prediction.

    Attributes
    ----------
    precision, recall
        None if nothing is predicted to be a vehicle, or if there are no vehicles.
    confusion
        Number of patches: vehicles, predicted as such or not; then non-vehicles, the same.
    groups
        Accuracy of each group.
    """

    patches: int
    accuracy: float
    precision: float | None
    recall: float | None
    confusion: list[list[int]]
    groups: dict[str, float]

    @classmethod
    def of(cls, vehicle: BoolArray, predicted: BoolArray, groups: npt.NDArray[np.str_]) -> Self:
        """Compare truth and prediction, bool `(n,)` each; groups are `(n,)`."""
        right, cells = vehicle == predicted, 2 * ~vehicle + ~predicted
        hits, misses, alarms, rejections = np.bincount(cells, minlength=4).tolist()
        return cls(
            patches=len(right),
            accuracy=float(right.mean()),
            precision=hits / (hits + alarms) if hits + alarms else None,
            recall=hits / (hits + misses) if hits + misses else None,
            confusion=[[hits, misses], [alarms, rejections]],
            groups={str(name): float(right[groups == name].mean()) for name in np.unique(groups)},
        )

    def lines(self) -> Iterator[str]:
        """Yield the metrics as lines of text."""
        yield f"patches tested: {self.patches}"
        for name in ("accuracy", "precision", "recall"):
            yield f"{name} {figure(getattr(self, name), 4)}"
        names = "is vehicle", "is non-vehicle"
        rows = [[name, *map(str, row)] for name, row in zip(names, self.confusion, strict=True)]
        yield from ("", *table(("", "predicted vehicle", "predicted non-vehicle"), rows))
        by_group = [[name, figure(accuracy, 4)] for name, accuracy in self.groups.items()]
        yield from ("", *table(("group", "accuracy"), by_group))


@dataclass(frozen=True, slots=True)
class TrainingMetrics:
    """The metrics of a training run: fitted on a part of the patches, tested on the others.

    Attributes
    ----------
    groups
        Number of patches of each group.
    samples
        Number of samples for the classifier: patches, and samples made from them.
    train_accuracy
        Accuracy on the patches among them.
    box_error
        Mean absolute error of the regression on known sides of test patches, as a fraction of the
        patch's side; None if no sides are known.
    """

    groups: dict[str, int]
    samples: int
    train_accuracy: float
    test: Classification
    box_error: float | None

    def lines(self) -> Iterator[str]:
        """Yield the metrics as lines of text."""
        yield from (f"{group:<28}{count:6d} patches" for group, count in self.groups.items())
        yield ""
        yield f"train accuracy {self.train_accuracy:.4f} ({self.samples} samples)"
        yield "tested on the last patches of each folder:"
        yield from self.test.lines()
        yield ""
        if self.box_error is None:
            yield "no patches from vdet mine: in video, such a model finds far fewer vehicles"
        else:
            yield f"sides of vehicles' boxes: mean error {self.box_error:.3f} of a patch's side"


def train(
    files: Sequence[PatchFile],
    settings: Settings,
    *,
    jobs: int | None = None,
    progress: Progress = no_progress,
) -> tuple[LinearModel, TrainingMetrics]:
    """Compute features, fit a model on a part of the patches, and test it on the others.

    Parameters
    ----------
    files
        If some have known sides, the model learns to find the sides of vehicles.
    jobs
        Number of threads that compute features; None: one per core.
    progress
        Called at the start of each step, with the number of patches or None.

    Returns
    -------
    The model fitted on all but the last patches of each group, with its provenance, and its
    metrics.

    Raises
    ------
    DataError
        Patches are unreadable, or too few.
    """
    advance = progress("describing patches", len(files))
    augmented = settings.train.svm.augmentation
    data = extract(files, settings.svm.features, augmented=augmented, jobs=jobs, progress=advance)
    held = hold_out(data.groups)
    learnt, tested = ~(held | data.is_boxed), held & ~data.is_boxed
    if not tested.any():
        raise DataError("no folder has two patches, so none can be held out; add more")
    progress("fitting the classifier", None)
    model = fit(data.of(learnt), settings)
    progress("fitting the sides of boxes", None)
    regression, box_error = fit_boxes(data, held, settings.svm.features.hog_length)
    metrics = TrainingMetrics(
        groups=dict(Counter(file.group for file in files)),
        samples=int(np.count_nonzero(learnt[data.origins])),
        train_accuracy=_classify(model, data, learnt).accuracy,
        test=_classify(model, data, tested),
        box_error=box_error,
    )
    training = settings.train.svm.model_dump(mode="json")
    program = {"program": f"vdet {__version__}"}
    provenance = program | {"training": training, "report": asdict(metrics)}
    return replace(model, provenance=provenance, box_regression=regression), metrics


def _classify(model: LinearModel, data: LabelledVectors, chosen: BoolArray) -> Classification:
    """Compare the chosen patches, bool `(patches,)`, with the predictions of the model."""
    probabilities = model.probabilities(data.vectors[data.patches[chosen]])
    predicted = probabilities >= THRESHOLD
    return Classification.of(data.labels[chosen], predicted, data.groups[chosen])
