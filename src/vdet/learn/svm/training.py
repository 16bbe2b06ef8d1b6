"""Train a model on patch files, with metrics."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Self

import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray
from vdet.config.schema import Settings
from vdet.detect.svm.model import LinearModel
from vdet.errors import DataError
from vdet.evaluate.output import figure, table
from vdet.learn.svm.dataset import PatchFile
from vdet.learn.svm.extraction import LabelledVectors, extract, hold_out
from vdet.learn.svm.fitting import fit, fit_boxes
from vdet.progress import Steps, no_steps
from vdet.version import __version__

THRESHOLD = 0.5
"""A patch with at least this probability is classified as a vehicle."""


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
    steps: Steps = no_steps,
) -> tuple[LinearModel, TrainingMetrics]:
    """Compute features, fit a model on a part of the patches, and test it on the others.

    Parameters
    ----------
    files
        If some have known sides, the model learns to find the sides of vehicles.
    jobs
        Number of threads that compute features; None: one per core.
    steps
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
    progress = steps("describing patches", len(files))
    augmented = settings.train.svm.augmentation
    data = extract(files, settings.svm.features, augmented=augmented, jobs=jobs, progress=progress)
    held = hold_out(data.groups)
    learnt, tested = ~(held | data.is_boxed), held & ~data.is_boxed
    if not tested.any():
        raise DataError("no folder has two patches, so none can be held out; add more")
    steps("fitting the classifier", None)
    model = fit(data.of(learnt), settings)
    steps("fitting the sides of boxes", None)
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
