"""What is said of a classifier: plain numbers, with the patches behind the worst of them."""

from dataclasses import dataclass, field

from vdet.learn.dataset import PatchFile
from vdet.learn.patch_eval.bootstrap import Interval
from vdet.learn.report import Confusion


@dataclass(frozen=True, slots=True)
class PatchScores:
    """The measures on some patches; None where a measure has no meaning for them.

    `intervals` has the 95 % interval of a measure by its name.
    """

    patches: int
    vehicles: int
    accuracy: float | None
    precision: float | None
    recall: float | None
    f1: float | None
    roc_auc: float | None
    average_precision: float | None
    log_loss: float | None
    calibration_error: float | None
    confusion: Confusion
    intervals: dict[str, Interval] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class GroupScores:
    """The scores on the test patches of one group, all of one class."""

    group: str
    scores: PatchScores


@dataclass(frozen=True, slots=True)
class ReliabilityBin:
    """Patches of like probability: their number, mean probability and share of vehicles."""

    patches: int
    mean_probability: float
    vehicle_share: float


@dataclass(frozen=True, slots=True)
class Mistake:
    """A patch on the wrong side, and its probability of being a vehicle."""

    file: PatchFile
    probability: float


@dataclass(frozen=True, slots=True)
class Curves:
    """Points of the ROC and the precision–recall curve."""

    false_positive_rates: tuple[float, ...]
    true_positive_rates: tuple[float, ...]
    precisions: tuple[float, ...]
    recalls: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class TrialReport:
    """A test: its name, what it means, and what came out.

    `reliability` leaves empty bins out; `mistakes` is sorted, the surest mistake first.
    """

    name: str
    meaning: str
    scores: PatchScores
    groups: tuple[GroupScores, ...]
    reliability: tuple[ReliabilityBin, ...]
    curves: Curves | None
    mistakes: tuple[Mistake, ...]


@dataclass(frozen=True, slots=True)
class PatchReport:
    """Everything about a set of patches: how many there are, and the tests on them."""

    vehicles: int
    non_vehicles: int
    broken: int
    trials: tuple[TrialReport, ...]
