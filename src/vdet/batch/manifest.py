"""The manifest: a line of JSON for every file of a batch, added the moment that it has ended."""

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
    """What made the results: the program with its version, the model's file and its SHA-256.

    The last two are None for a detector without a model file.
    """

    program: str
    model: str | None
    model_sha256: str | None


@dataclass(frozen=True, slots=True)
class Record:
    """What became of a file.

    `input` is an absolute name, `outputs` has that of each output by the name of its sink. `width`
    and `height` are of the upright picture in pixels, `frames` were read, `tracks` vehicles
    followed, in `seconds` of wall time from `started`, in UTC. `error` is None where all went well;
    else there is no output, and of the numbers only the seconds are known.
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
def appending(path: Path, origin: Origin) -> Iterator[Callable[[Record], None]]:
    """Give a function that adds a record to the manifest, and to the disk before it returns.

    Raises
    ------
    OutputError
        The file cannot be written (from the function, too).
    """
    with _naming(path):
        file = path.open("ab", buffering=0)
    with file:

        def add(record: Record) -> None:
            line = json.dumps(asdict(record) | asdict(origin), allow_nan=False) + "\n"
            with _naming(path):
                if file.write(line.encode()) != len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(file.fileno())

        with _naming(path):
            _end_last_line(path, file.write)
        yield add


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error


def _end_last_line(path: Path, write: Callable[[bytes], object]) -> None:
    """Begin on a line of our own, after what a full disk may have cut off."""
    with path.open("rb") as file:
        if file.seek(0, os.SEEK_END):
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":
                write(b"\n")
