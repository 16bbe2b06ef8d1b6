"""How well a linear model classifies patches: the metrics of `vdet train`, printed and as JSON."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray
from vdet.evaluate.output import ABSENT, share, table
from vdet.files import write_json

CONFUSION_HEADINGS = ("", "predicted vehicle", "predicted non-vehicle")


@dataclass(frozen=True, slots=True)
class Rate:
    """A share of patches, with its 95 % interval; None where there are no patches.

    Source of the interval: Wilson, "Probable inference", 1927. It takes the patches for
    independent; with near-duplicates in the test the true interval is wider.
    """

    value: float | None
    low: float | None
    high: float | None

    @classmethod
    def of(cls, right: BoolArray) -> Self:
        """Return the share of the True ones, bool `(n,)`."""
        from scipy.stats import binomtest  # type: ignore[import-untyped]

        if not len(right):
            return cls(None, None, None)
        count = int(np.count_nonzero(right))
        interval = binomtest(count, len(right)).proportion_ci(method="wilson")
        return cls(count / len(right), float(interval.low), float(interval.high))

    def __str__(self) -> str:
        if self.value is None:
            return ABSENT
        return f"{share(self.value, 4)} [{share(self.low)}, {share(self.high)}]"


@dataclass(frozen=True, slots=True)
class Classification:
    """Patches by truth and prediction.

    Attributes
    ----------
    confusion
        Number of patches: found vehicles, missed vehicles; false alarms, other non-vehicles.
    groups
        Accuracy of each group.
    """

    patches: int
    accuracy: Rate
    confusion: list[list[int]]
    groups: dict[str, Rate]

    @classmethod
    def of(cls, vehicle: BoolArray, predicted: BoolArray, groups: npt.NDArray[np.str_]) -> Self:
        """Compare the truth, bool `(n,)`, with the prediction, bool `(n,)`; groups are `(n,)`."""
        from sklearn.metrics import confusion_matrix

        right = vehicle == predicted
        confusion = confusion_matrix(vehicle, predicted, labels=[True, False]).tolist()
        by_group = {name: Rate.of(right[groups == name]) for name in np.unique(groups).tolist()}
        return cls(len(right), Rate.of(right), confusion, by_group)

    def confusion_rows(self) -> list[list[str]]:
        """Return the rows of text under `CONFUSION_HEADINGS`."""
        names = ("is vehicle", "is non-vehicle")
        return [[name, *map(str, row)] for name, row in zip(names, self.confusion, strict=True)]

    def group_rows(self) -> list[list[str]]:
        """Return the name of each group and its accuracy as text."""
        return [[name, str(rate)] for name, rate in self.groups.items()]

    def lines(self) -> Iterator[str]:
        """Yield the tables as lines of text."""
        yield from table(CONFUSION_HEADINGS, self.confusion_rows())
        yield ""
        yield from table(("accuracy by group", "95 % interval"), self.group_rows())


_SPLITS = {
    "random": "random split (near-duplicates on both sides; vdet eval patches leaks nothing)",
    "tail": "tail split (leak-free: the last patches of each folder)",
}


@dataclass(frozen=True, slots=True)
class TrainingMetrics:
    """The metrics of a training run: fitted on a part of the patches, tested on the others.

    Attributes
    ----------
    boxed
        Number of patches with a known box, including those of neither class.
    groups
        Number of patches of each group.
    train_augmented
        Number of samples made of the training patches.
    box_error
        Mean absolute error of the regression on known sides of tested patches, as a share of the
        patch's side; None if no sides are known.
    """

    vehicles: int
    non_vehicles: int
    boxed: int
    groups: dict[str, int]
    features: int
    split: str
    train_patches: int
    train_augmented: int
    train_accuracy: float
    test: Classification
    box_error: float | None

    def lines(self) -> Iterator[str]:
        """Yield the metrics as lines of text."""
        yield (
            f"patches: {self.vehicles} vehicles, {self.non_vehicles} non-vehicles, "
            f"{self.boxed} with the box of their vehicle; {self.features} features each"
        )
        yield from (f"  {group:<28}{count:6d} patches" for group, count in self.groups.items())
        yield ""
        yield _SPLITS[self.split]
        more = f" + {self.train_augmented} augmented" if self.train_augmented else ""
        yield (
            f"train accuracy {self.train_accuracy:.4f} ({self.train_patches} patches{more}), "
            f"test accuracy {self.test.accuracy} ({self.test.patches} patches)"
        )
        yield from self.test.lines()
        if self.box_error is not None:
            yield f"sides of vehicles' boxes: mean error {self.box_error:.3f} of a patch's side"
        if not self.boxed:
            yield ""
            yield "no patch came from vdet mine: in video, such a model finds far fewer vehicles"

    def write(self, path: Path, *, overwrite: bool = False) -> None:
        """Write the metrics as JSON. Raises `OutputError`."""
        write_json(asdict(self), str(path), overwrite=overwrite)
