"""The manifest: a line of JSON for every file of a batch, added as soon as the file is done."""

import errno
import json
import os
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from vdet.errors import OutputError
from vdet.files import output_errors
from vdet.system import lock
from vdet.version import __version__

_FLAGS = sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))


@dataclass(frozen=True, slots=True)
class Record:
    """The result of one file.

    Attributes
    ----------
    input, outputs
        Absolute paths; that of each output is under the name of its sink, or all of them where the
        sink writes several.
    started
        In UTC, as ISO 8601 writes it.
    seconds
        Wall time.
    width, height
        Size of the upright picture, pixels.
    frames, tracks
        Number of frames read, and of tracks shown.
    begin
        When the video was recorded, and where that is known from, if it is.
    conditions
        What makes the result doubtful: `Finding.record` of each.
    error
        None if all went well; else there are no outputs, and of the numbers only the seconds.
    digest
        SHA-256 of all that the outputs depend on: see `vdet.batch.task`. None without outputs.
    sizes, times
        Bytes of each output and the time of its last change (nanoseconds since 1970), by its path;
        of a folder the sum and the latest of the files in it.
    summaries
        What the sinks say of the outputs, by their paths: see `BatchTotal`.
    program
        The program with its version.
    model, model_sha256
        Name and SHA-256 of the model file; None for a detector without one.
    """

    input: str
    outputs: Mapping[str, str | tuple[str, ...]]
    started: str
    seconds: float
    width: int | None = None
    height: int | None = None
    frames: int | None = None
    tracks: int | None = None
    begin: str | None = None
    warnings: tuple[str, ...] = ()
    conditions: tuple[Mapping[str, Any], ...] = ()
    error: str | None = None
    digest: str | None = None
    sizes: Mapping[str, int] = field(default_factory=dict)
    times: Mapping[str, int] = field(default_factory=dict)
    summaries: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    program: str = f"vdet {__version__}"
    model: str | None = None
    model_sha256: str | None = None


class Written(NamedTuple):
    """What the manifest says about an output, as in `Record`."""

    digest: str | None
    size: int
    time: int
    summary: Mapping[str, Any] | None


def check_manifest(path: Path) -> None:
    """Refuse a link, which may lead out of the folder, and a FIFO, which may block for ever.

    Raises
    ------
    OutputError
        What is there is not a regular file.
    """
    if os.path.lexists(path) and not stat.S_ISREG(path.lstat().st_mode):
        raise OutputError(f"{path}: is not a regular file; remove it, or give another folder")


def read_written(path: Path) -> dict[str, Written]:
    """Return what is written of each output, by its real path; the latest record counts.

    Lines that are no records of outputs are skipped. Without a manifest there is none.

    Raises
    ------
    OutputError
        The manifest cannot be read.
    """
    found: dict[str, Written] = {}
    if not os.path.lexists(path):
        return found
    with output_errors(path), os.fdopen(os.open(path, os.O_RDONLY | _FLAGS), "rb") as file:
        for text in file:
            with suppress(ValueError, TypeError, KeyError, AttributeError):
                line = json.loads(text)
                for name, size in line["sizes"].items():
                    summary = line.get("summaries", {}).get(name)
                    written = Written(line["digest"], size, line["times"][name], summary)
                    found[os.path.realpath(name)] = written
    return found


@contextmanager
def open_manifest(path: Path) -> Iterator[Callable[[Record], None]]:
    """Give a function that adds a record to the manifest; it returns when the disk has it.

    The manifest is locked: no other batch can write into the folder until the block ends.

    Raises
    ------
    OutputError
        The file cannot be written (from the function, too), or another batch has locked it.
    """
    check_manifest(path)
    with output_errors(path):
        descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | _FLAGS, 0o666)
    with os.fdopen(descriptor, "r+b", buffering=0) as file:
        try:
            lock(descriptor)
        except BlockingIOError:
            message = f"{path}: another batch writes here; wait, or give another folder"
            raise OutputError(message) from None

        def add(record: Record) -> None:
            line = json.dumps(asdict(record), allow_nan=False) + "\n"
            with output_errors(path):
                if file.write(line.encode()) != len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(descriptor)

        with output_errors(path):
            _end_last_line(file)
        yield add


def _end_last_line(file: BinaryIO) -> None:
    """End a last line that was cut off by a full disk."""
    if file.seek(0, os.SEEK_END):
        file.seek(-1, os.SEEK_END)
        if file.read(1) != b"\n":
            file.write(b"\n")
