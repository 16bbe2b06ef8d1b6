"""The manifest: a line of JSON for every file of a batch, added as soon as the file is done.

Whoever processes a file leaves its record as a note in a hidden folder of the batch, just before
the outputs get their names. The note moves into the manifest when the file is done, or when the
next batch begins, so no kill can separate outputs from their record.
"""

import errno
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from vdet.errors import OutputError
from vdet.files import output_errors, remove_stale, write_whole
from vdet.system import lock
from vdet.version import __version__

MANIFEST = "manifest.jsonl"
_NOTES = ".vdet-notes"
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
    error
        None if all went well; else there are no outputs, and of the numbers only the seconds.
    digest
        SHA-256 of all that the outputs depend on: see `vdet.batch.task`. None without outputs.
    sizes, times
        Bytes of each output and the time of its last change (nanoseconds since 1970), by its path;
        of a folder the sum and the latest of the files in it.
    facts
        What steps found out about the whole video, by their names.
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
    error: str | None = None
    digest: str | None = None
    sizes: Mapping[str, int] = field(default_factory=dict)
    times: Mapping[str, int] = field(default_factory=dict)
    facts: Mapping[str, Any] = field(default_factory=dict)
    summaries: Mapping[str, Any] = field(default_factory=dict)
    program: str = f"vdet {__version__}"
    model: str | None = None
    model_sha256: str | None = None

    @property
    def line(self) -> str:
        """The line of the manifest."""
        return json.dumps(asdict(self), allow_nan=False) + "\n"

    def note(self, folder: Path) -> Path:
        """Return where the note lies in the folder of a batch; it depends on the outputs alone."""
        name = hashlib.sha256(json.dumps(self.outputs).encode()).hexdigest()
        return folder / _NOTES / f"{name[:32]}.json"

    def leave_note(self, folder: Path) -> None:
        """Write the note. Raises `OutputError`."""
        write_whole(self.note(folder), self.line, overwrite=True)


class Written(NamedTuple):
    """What a record says about an output."""

    digest: str | None
    state: tuple[int, int]
    summary: Any


def written_outputs(records: Iterable[Record]) -> dict[str, list[Written]]:
    """Return what is written of each output, by its real path; the latest record comes last."""
    found: dict[str, list[Written]] = {}
    for each in records:
        for name, size in each.sizes.items():
            state = size, each.times[name]
            written = Written(each.digest, state, each.summaries.get(name))
            found.setdefault(os.path.realpath(name), []).append(written)
    return found


def read_records(*paths: Path) -> Iterator[Record]:
    """Yield the records in some files; what does not exist, or is not a record, is skipped.

    Raises
    ------
    OutputError
        A file cannot be read.
    """
    known = {each.name for each in fields(Record)}
    for path in filter(os.path.lexists, paths):
        with output_errors(path), os.fdopen(os.open(path, os.O_RDONLY | _FLAGS), "rb") as file:
            for text in file:
                with suppress(ValueError, TypeError, AttributeError):
                    line = json.loads(text)
                    yield Record(**{key: line[key] for key in known & line.keys()})


def read_batch(folder: Path) -> Iterator[Record]:
    """Yield the records of all batches into a folder, in order. Errors as of `read_records`."""
    return read_records(folder / MANIFEST, *_notes(folder))


def _notes(folder: Path) -> list[Path]:
    return sorted((folder / _NOTES).glob("*.json"))


@contextmanager
def open_manifest(folder: Path) -> Iterator[Callable[[Record], None]]:
    """Give a function that adds a record to the manifest; it returns when the disk has it.

    The manifest is locked: no other batch can write into the folder until the block ends. Notes
    that an earlier batch left move into it.

    Raises
    ------
    OutputError
        The file cannot be written (from the function, too), or another batch has locked it.
    """
    path = folder / MANIFEST
    with output_errors(path):
        descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | _FLAGS, 0o666)
    with os.fdopen(descriptor, "r+b", buffering=0) as file:
        try:
            lock(descriptor)
        except BlockingIOError:
            message = f"{path}: another batch writes here; wait, or use another folder"
            raise OutputError(message) from None

        def add(record: Record) -> None:
            with output_errors(path):
                if file.write(record.line.encode()) != len(record.line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(descriptor)
                record.note(folder).unlink(missing_ok=True)

        with output_errors(path):
            _end_last_line(file)
        for note in _notes(folder):
            for record in read_records(note):
                add(record)
        try:
            yield add
        finally:
            remove_stale(folder / _NOTES)
            with suppress(OSError):  # a worker of an earlier batch may still write into it
                (folder / _NOTES).rmdir()


def _end_last_line(file: BinaryIO) -> None:
    """End a last line that was cut off by a full disk."""
    if file.seek(0, os.SEEK_END):
        file.seek(-1, os.SEEK_END)
        if file.read(1) != b"\n":
            file.write(b"\n")
