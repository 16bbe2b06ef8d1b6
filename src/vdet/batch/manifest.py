"""The manifest: a line of JSON for every file of a batch, added as soon as the file is done."""

import errno
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from vdet.errors import OutputError


@dataclass(frozen=True, slots=True)
class Origin:
    """How the results were made: the program with its version, the model file and its SHA-256.

    The last two are None for a detector without a model file.
    """

    program: str
    model: str | None
    model_sha256: str | None


@dataclass(frozen=True, slots=True)
class Record:
    """The result of one file.

    Attributes
    ----------
    input, outputs
        Absolute paths; that of each output is under the name of its sink.
    started
        In UTC, as ISO 8601 writes it.
    seconds
        Wall time.
    width, height
        Size of the upright picture, pixels.
    frames, tracks
        How many frames were read, and how many vehicles were followed.
    error
        None if all went well; else there are no outputs, and of the numbers only the seconds.
    """

    input: str
    outputs: dict[str, str]
    started: str
    seconds: float
    width: int | None = None
    height: int | None = None
    frames: int | None = None
    tracks: int | None = None
    warnings: tuple[str, ...] = ()
    error: str | None = None


@contextmanager
def open_manifest(path: Path, origin: Origin) -> Iterator[Callable[[Record], None]]:
    """Give a function that adds a record to the manifest; it returns when the disk has it.

    Raises
    ------
    OutputError
        The file cannot be written (from the function, too).
    """
    with _named_errors(path):
        file = path.open("ab", buffering=0)
    with file:

        def add(record: Record) -> None:
            line = json.dumps(asdict(record) | asdict(origin), allow_nan=False) + "\n"
            with _named_errors(path):
                if file.write(line.encode()) != len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(file.fileno())

        with _named_errors(path):
            _end_last_line(path, file.write)
        yield add


@contextmanager
def _named_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error


def _end_last_line(path: Path, write: Callable[[bytes], object]) -> None:
    """End a last line that was cut off by a full disk."""
    with path.open("rb") as file:
        if file.seek(0, os.SEEK_END):
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":
                write(b"\n")
