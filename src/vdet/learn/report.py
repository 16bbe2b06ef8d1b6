"""What `vdet train` says of a model: plain numbers, printed and kept as JSON."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vdet.files import write_json


@dataclass(frozen=True, slots=True)
class Confusion:
    """Test patches by truth and prediction."""

    true_positives: int
    false_positives: int
    false_negatives: int
    true_negatives: int

    @staticmethod
    def of(truth: npt.NDArray[np.bool_], predicted: npt.NDArray[np.bool_]) -> "Confusion":
        """Count from bool arrays of shape `(n,)`."""
        return Confusion(
            int(np.count_nonzero(truth & predicted)),
            int(np.count_nonzero(~truth & predicted)),
            int(np.count_nonzero(truth & ~predicted)),
            int(np.count_nonzero(~truth & ~predicted)),
        )


@dataclass(frozen=True, slots=True)
class GroupAccuracy:
    """Share of a group's test patches that are classified rightly."""

    group: str
    patches: int
    accuracy: float


@dataclass(frozen=True, slots=True)
class BoxError:
    """How far the regression misses the known sides of held-out patches' boxes.

    `mean` is the mean absolute error in sides of the patch, `patches` how many were looked at.
    """

    patches: int
    mean: float


@dataclass(frozen=True, slots=True)
class SplitReport:
    """A model fitted on one part of the patches and tested on the other.

    `train_views` views of the training patches were learnt from too. `boxes` is None where no
    boxes are known.
    """

    split: str
    train_patches: int
    train_views: int
    test_patches: int
    train_accuracy: float
    test_accuracy: float
    confusion: Confusion
    groups: tuple[GroupAccuracy, ...]
    boxes: BoxError | None
    fit_seconds: float


@dataclass(frozen=True, slots=True)
class TrainingReport:
    """Everything that is said of a training run; the saved model is the first split's.

    `boxed` counts the patches with a known box, also those that belong to neither class; `groups`
    all patches of each group.
    """

    vehicles: int
    non_vehicles: int
    boxed: int
    broken: int
    groups: dict[str, int]
    features: int
    extract_seconds: float
    milliseconds_per_prediction: float
    splits: tuple[SplitReport, ...]

    def lines(self) -> Iterator[str]:
        """Give the report as lines of text."""
        broken = f" ({self.broken} broken ones skipped)" if self.broken else ""
        yield (
            f"patches: {self.vehicles} vehicles, {self.non_vehicles} non-vehicles{broken}; "
            f"{self.features} features each, described in {self.extract_seconds:.1f} s"
        )
        if self.boxed:
            yield f"patches with the box of their vehicle: {self.boxed}"
        for group, count in self.groups.items():
            yield f"  {group:<28}{count:6d} patches"
        for split in self.splits:
            yield from _split_lines(split)
        yield ""
        yield f"one prediction: {self.milliseconds_per_prediction:.2f} ms, features included"

    def write(self, path: Path) -> None:
        """Write the report as JSON. Raises `OutputError`."""
        write_json(asdict(self), str(path))


_SPLITS = {
    "random": "random split (near-duplicates on both sides)",
    "tail": "tail split (leak-free: the last patches of each folder)",
}


def _split_lines(report: SplitReport) -> Iterator[str]:
    confusion = report.confusion
    yield ""
    yield _SPLITS[report.split]
    views = f" + {report.train_views} views" if report.train_views else ""
    yield (
        f"  train accuracy {report.train_accuracy:.4f} ({report.train_patches} patches{views}), "
        f"test accuracy {report.test_accuracy:.4f} ({report.test_patches} patches), "
        f"fitted in {report.fit_seconds:.1f} s"
    )
    yield "                        said vehicle   said non-vehicle"
    yield (f"  is vehicle      {confusion.true_positives:18d} {confusion.false_negatives:18d}")
    yield (f"  is non-vehicle  {confusion.false_positives:18d} {confusion.true_negatives:18d}")
    for group in report.groups:
        yield f"  {group.group:<28}{group.patches:6d} patches  accuracy {group.accuracy:.4f}"
    if report.boxes is not None:
        yield (
            f"  sides of vehicles' boxes: {report.boxes.mean:.3f} of a patch's side off on average "
            f"({report.boxes.patches} patches)"
        )
