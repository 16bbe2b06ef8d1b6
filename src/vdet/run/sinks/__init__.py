"""The outputs of a run, one module per output."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Output:
    """An output of a run: the name of its sink, its path, and the file over its batch, if any."""

    sink: str
    path: Path
    total: Path | None = None
