"""What evaluations show as text: tables, ratios, and the detector that was measured."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vdet.version import __version__


@dataclass(frozen=True, slots=True)
class RunName:
    """Which detector was measured: its kind, its model file, its settings and changes to them."""

    detector: str
    model: Path | None
    config: str | None
    assignments: tuple[str, ...] = ()

    @property
    def line(self) -> str:
        """It as a line of text."""
        model = f", model {self.model.name}" if self.model else ""
        settings = " ".join([self.config or "default", *self.assignments])
        return f"vdet {__version__}, detector {self.detector}{model}, settings {settings}"

    @property
    def values(self) -> dict[str, Any]:
        """The same facts as values for JSON."""
        model = self.model and str(self.model)
        return {"program": f"vdet {__version__}", **asdict(self), "model": model}


def figure(value: float | str | None, digits: int = 3) -> str:
    """Write a text, a count, or a ratio with some digits; a dash for None."""
    if value is None:
        return "–"
    return str(value) if isinstance(value, int | str) else f"{value:.{digits}f}"


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
