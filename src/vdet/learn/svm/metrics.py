"""The metrics of a model that `vdet train` trains: numbers, printed and written as JSON."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from vdet.boxes import BoolArray
from vdet.evaluate.output import table
from vdet.files import write_json


@dataclass(frozen=True, slots=True)
class Confusion:
    """Test patches by truth and prediction."""

    true_positives: int
    false_positives: int
    false_negatives: int
    true_negatives: int

    @staticmethod
    def of(truth: BoolArray, predicted: BoolArray) -> "Confusion":
        """Count the patches of two bool arrays `(n,)`."""
        return Confusion(
            int(np.count_nonzero(truth & predicted)),
            int(np.count_nonzero(~truth & predicted)),
            int(np.count_nonzero(truth & ~predicted)),
            int(np.count_nonzero(~truth & ~predicted)),
        )

    def rows(self) -> list[list[str]]:
        """Return the rows of a table, with the columns "", predicted vehicle, predicted other."""
        return [
            ["is vehicle", str(self.true_positives), str(self.false_negatives)],
            ["is non-vehicle", str(self.false_positives), str(self.true_negatives)],
        ]


@dataclass(frozen=True, slots=True)
class GroupAccuracy:
    """Share of a group's test patches that are classified correctly."""

    group: str
    patches: int
    accuracy: float


@dataclass(frozen=True, slots=True)
class BoxError:
    """Error of the regression on the known box sides of held-out patches.

    `mean` is the mean absolute error as a share of the patch's side, `patches` their number.
    """

    patches: int
    mean: float


@dataclass(frozen=True, slots=True)
class SplitMetrics:
    """A model fitted on one part of the patches and tested on the other.

    `train_augmented` is the number of samples made of the training patches. `boxes` is None if no
    boxes are known.
    """

    split: str
    train_patches: int
    train_augmented: int
    test_patches: int
    train_accuracy: float
    test_accuracy: float
    confusion: Confusion
    groups: tuple[GroupAccuracy, ...]
    boxes: BoxError | None
    fit_seconds: float


@dataclass(frozen=True, slots=True)
class TrainingMetrics:
    """The metrics of a training run; the saved model is that of the first split.

    `boxed` is the number of patches with a known box, including those of neither class; `groups`
    has the number of patches of each group.
    """

    vehicles: int
    non_vehicles: int
    boxed: int
    broken: int
    groups: dict[str, int]
    features: int
    extract_seconds: float
    milliseconds_per_prediction: float
    splits: tuple[SplitMetrics, ...]

    def lines(self) -> Iterator[str]:
        """Yield the metrics as lines of text."""
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
        if not self.boxed:
            yield ""
            yield (
                "no patch came from vdet mine: in video, such a model finds far fewer vehicles; "
                "docs/training.md says how to mine labelled video"
            )

    def write(self, path: Path, *, overwrite: bool = False) -> None:
        """Write the metrics as JSON. Raises `OutputError`."""
        write_json(asdict(self), str(path), overwrite=overwrite)


_SPLITS = {
    "random": "random split (near-duplicates on both sides)",
    "tail": "tail split (leak-free: the last patches of each folder)",
}


def _split_lines(metrics: SplitMetrics) -> Iterator[str]:
    yield ""
    yield _SPLITS[metrics.split]
    more = f" + {metrics.train_augmented} augmented" if metrics.train_augmented else ""
    yield (
        f"  train accuracy {metrics.train_accuracy:.4f} ({metrics.train_patches} patches{more}), "
        f"test accuracy {metrics.test_accuracy:.4f} ({metrics.test_patches} patches), "
        f"fitted in {metrics.fit_seconds:.1f} s"
    )
    headings = "", "predicted vehicle", "predicted non-vehicle"
    yield from (f"  {line}" for line in table(headings, metrics.confusion.rows()))
    for group in metrics.groups:
        yield f"  {group.group:<28}{group.patches:6d} patches  accuracy {group.accuracy:.4f}"
    if metrics.boxes is not None:
        yield (
            f"  sides of vehicles' boxes: mean error {metrics.boxes.mean:.3f} of a patch's side "
            f"({metrics.boxes.patches} patches)"
        )
