"""The outputs of a run, one module per output."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Output:
    """An output of a run: its sink, its path, and in a batch the file over all videos, if any."""

    sink: str
    path: Path
    total: Path | None = None
