"""Text of evaluations: tables, ratios, and the measured detector."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vdet.version import __version__


@dataclass(frozen=True, slots=True)
class RunName:
    """The measured detector: kind, model file, settings and changes to them."""

    detector: str
    model: Path | None
    config: str | None
    assignments: tuple[str, ...] = ()

    @property
    def line(self) -> str:
        """The description as a line of text."""
        model = f", model {self.model.name}" if self.model else ""
        settings = " ".join([self.config or "default", *self.assignments])
        return f"vdet {__version__}, detector {self.detector}{model}, settings {settings}"

    @property
    def values(self) -> dict[str, Any]:
        """The description as values for JSON."""
        model = self.model and str(self.model)
        return {"program": f"vdet {__version__}", **asdict(self), "model": model}


def figure(value: float | str | None, digits: int = 3) -> str:
    """Format a text, a count, or a ratio with some digits; a dash for None."""
    if value is None:
        return "–"
    return str(value) if isinstance(value, int | str) else f"{value:.{digits}f}"


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a table as lines of text, the first column left-aligned, the others right-aligned.

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
