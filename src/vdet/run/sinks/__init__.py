"""The outputs of a run, one module per output."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Output:
    """An output of a run: the name of its sink, and its path."""

    sink: str
    path: Path
