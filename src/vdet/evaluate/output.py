"""Results as text: tables, ratios, and which detector was measured."""

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

    Its kind, model file, file of settings and changes to them, and the names of the data that the
    model was trained on, as far as its file says.
    """

    kind: str
    model: Path | None
    config: str | None
    assignments: tuple[str, ...]
    trained_on: tuple[str, ...] = ()


def run_name(
    detector: DetectorSettings, model: Path | None, config: str | None, assignments: tuple[str, ...]
) -> RunName:
    """Return which detector is measured; `model` is its file, None for the shipped one."""
    file = model_file(detector, model)
    return RunName(detector.kind, file, config, assignments, trained_on(detector, file))


def run_lines(run: RunName) -> list[str]:
    """Return which detector was measured, and what its model was trained on."""
    model = f", model {run.model.name}" if run.model else ""
    settings = " ".join([run.config or "default", *run.assignments])
    lines = [f"vdet {__version__}, detector {run.kind}{model}, settings {settings}"]
    if run.trained_on:
        lines.append(f"trained on {', '.join(run.trained_on)}")
    return lines


def plain_run(run: RunName) -> dict[str, Any]:
    """Return which detector was measured as values for JSON."""
    return {
        "program": f"vdet {__version__}",
        "detector": run.kind,
        "model": str(run.model) if run.model else None,
        "config": run.config or "default",
        "set": list(run.assignments),
        "trained_on": list(run.trained_on),
    }


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
    return [_line(row, widths) for row in (headings, *rows)]


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = zip(row, widths, strict=True)
    cells = [first[0].ljust(first[1]), *(text.rjust(width) for text, width in others)]
    return "  ".join(cells).rstrip()


def share(value: float | None, digits: int = 3) -> str:
    """Write a ratio; a dash for None."""
    return ABSENT if value is None else f"{value:.{digits}f}"
