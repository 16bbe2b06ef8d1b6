"""What evaluations show as text: tables, ratios, and the detector that was measured."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vdet.config.schema import DetectorSettings
from vdet.detect.factory import model_file, trained_on
from vdet.version import __version__

ABSENT = "–"


@dataclass(frozen=True, slots=True)
class RunName:
    """Which detector was measured.

    The fields are its kind, its model file, the file of settings and the changes to them, and the
    names of the training data if the model file contains them.
    """

    detector: str
    model: Path | None
    config: str | None
    assignments: tuple[str, ...]
    trained_on: tuple[str, ...] = ()

    @staticmethod
    def of(
        detector: DetectorSettings, config: str | None, assignments: tuple[str, ...]
    ) -> "RunName":
        """Return the name of a run."""
        file = model_file(detector)
        return RunName(detector.kind, file, config, assignments, trained_on(detector))

    def lines(self) -> list[str]:
        """Return the detector, and the data that its model was trained on, as lines of text."""
        model = f", model {self.model.name}" if self.model else ""
        settings = " ".join([self.config or "default", *self.assignments])
        lines = [f"vdet {__version__}, detector {self.detector}{model}, settings {settings}"]
        return [*lines, f"trained on {', '.join(self.trained_on)}"] if self.trained_on else lines

    def values(self) -> dict[str, Any]:
        """Return the same facts as values for JSON."""
        return {
            "program": f"vdet {__version__}",
            "detector": self.detector,
            "model": str(self.model) if self.model else None,
            "config": self.config or "default",
            "set": list(self.assignments),
            "trained_on": list(self.trained_on),
        }


def figure(value: float | None) -> str:
    """Write a count or a ratio; a dash for None."""
    return str(value) if isinstance(value, int) else share(value)


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return aligned lines, headings first: the first column to the left, the others to the right.

    Parameters
    ----------
    headings
        One per column.
    rows
        One text per column each.
    """
    widths = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
    form = "  ".join(f"{{:{'>' if number else '<'}{width}}}" for number, width in enumerate(widths))
    return [form.format(*row).rstrip() for row in (headings, *rows)]


def share(value: float | None, digits: int = 3) -> str:
    """Write a ratio; a dash for None."""
    return ABSENT if value is None else f"{value:.{digits}f}"
