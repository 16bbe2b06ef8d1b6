"""The report of `vdet adapt`: numbers, printed and written as JSON."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vdet.config.schema import CameraSearch
from vdet.evaluate.output import table
from vdet.evaluate.scores import Scores
from vdet.files import write_json


@dataclass(frozen=True, slots=True)
class ClipReport:
    """A clip: its name and SHA-256, and its number of frames to learn from and to check."""

    name: str
    sha256: str
    learnt: int
    checked: int


@dataclass(frozen=True, slots=True)
class RoundReport:
    """What a round of learning had: patches of vehicles, of other things, and for boxes."""

    vehicles: int
    non_vehicles: int
    boxes: int


@dataclass(frozen=True, slots=True)
class CheckReport:
    """How a detector did as video in the footage that was kept back.

    `against` names the labels: "teacher" or "truth".
    """

    detector: str
    against: str
    f1: float
    precision: float
    recall: float
    mean_iou: float
    false_tracks: int

    @staticmethod
    def of(detector: str, against: str, scores: Scores) -> "CheckReport":
        """Take the figures from the scores of a comparison."""
        return CheckReport(
            detector,
            against,
            round(scores.f1, 4),
            round(scores.precision, 4),
            round(scores.recall, 4),
            round(scores.mean_iou, 4),
            scores.false_tracks,
        )


def f1_against(checks: Sequence[CheckReport], against: str) -> dict[str, float]:
    """Return the F1 of each detector that was compared with these labels."""
    return {each.detector: each.f1 for each in checks if each.against == against}


@dataclass(frozen=True, slots=True)
class AdaptReport:
    """The report: the footage, the labels, the rounds, the search, and the check.

    `vehicles` is the number of labelled boxes of vehicles. `chosen` names the detector of `checks`
    that became the adapted model. `seconds` is the wall time.
    """

    clips: tuple[ClipReport, ...]
    teacher: str
    vehicles: int
    camera: CameraSearch
    rounds: tuple[RoundReport, ...]
    checks: tuple[CheckReport, ...]
    chosen: str
    seconds: float

    @property
    def gain(self) -> float:
        """By how much the F1 of the adapted model is higher, against the truth if there is one."""
        f1 = f1_against(self.checks, self.checks[-1].against)
        return f1[self.chosen] - f1["base"]

    def values(self) -> dict[str, Any]:
        """Return the report as JSON values."""
        return asdict(self) | {"camera": self.camera.model_dump(mode="json")}

    def lines(self) -> Iterator[str]:
        """Yield the report as lines of text."""
        for clip in self.clips:
            yield f"{clip.name}: {clip.learnt} frames to learn from, {clip.checked} to check"
        yield f"labels of {self.teacher}: {self.vehicles} boxes of vehicles"
        for number, each in enumerate(self.rounds, start=1):
            yield (
                f"round {number}: {each.vehicles} patches of vehicles, {each.non_vehicles} of "
                f"other things, {each.boxes} more for boxes"
            )
        yield ""
        yield "frames kept back, as video:"
        headings = ("detector", "against", "F1", "precision", "recall", "IoU", "false tracks")
        yield from table(
            headings,
            [
                (
                    each.detector,
                    each.against,
                    *(f"{v:.3f}" for v in (each.f1, each.precision, each.recall, each.mean_iou)),
                    str(each.false_tracks),
                )
                for each in self.checks
            ],
        )
        yield f"taken: {self.chosen}; {self.seconds:.0f} s"

    def write(self, path: Path, *, overwrite: bool = False) -> None:
        """Write the report as JSON. Raises `OutputError`."""
        write_json(self.values(), str(path), overwrite=overwrite)
