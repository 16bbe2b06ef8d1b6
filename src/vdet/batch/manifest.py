"""The manifest: a line of JSON for every file of a batch, added as soon as the file is done.

The worker writes the record of a file as a note into a hidden folder of the batch, just before the
outputs are renamed. The note moves into the manifest when the file is done, or when the next batch
begins, so that a killed batch never has outputs without their record.
"""

import errno
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from vdet.errors import OutputError
from vdet.files import output_errors, remove_stale
from vdet.run.result import CONDITIONS
from vdet.system import lock
from vdet.version import __version__

MANIFEST = "manifest.jsonl"
_NOTES = ".vdet-notes"
_FLAGS = sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))


@dataclass(frozen=True, slots=True)
class Written:
    """A written output.

    Attributes
    ----------
    sink, path
        The name of its sink; its absolute path.
    bytes, changed
        Its size and modification time (nanoseconds since 1970); for a folder, the sum and the
        latest of its files.
    digest
        SHA-256 of everything that it depends on: see `vdet.batch.task`.
    summary
        What a file over all videos needs from it: see `BatchTotal`.
    """

    sink: str
    path: str
    bytes: int
    changed: int
    digest: str
    summary: Any = None

    @property
    def state(self) -> tuple[int, int]:
        """Its size and time, as in `output_state`."""
        return self.bytes, self.changed


@dataclass(frozen=True, slots=True)
class Record:
    """The result of one file.

    Attributes
    ----------
    input
        Its absolute path.
    started
        Start time in UTC, ISO 8601.
    seconds
        Wall time.
    model, model_sha256
        Name and SHA-256 of the model file; None for a detector without one.
    width, height
        Size of the upright frames, pixels.
    frames, tracks
        Number of frames read, and of tracks shown.
    begin
        When the recording began, and the source of that time; None if unknown.
    facts
        What steps found out about the whole video, by name.
    outputs
        Empty after an error.
    error
        None on success; otherwise there are no outputs, and no numbers except the seconds.
    program
        Name and version of the program.
    """

    input: str
    started: str
    seconds: float = 0.0
    model: str | None = None
    model_sha256: str | None = None
    width: int | None = None
    height: int | None = None
    frames: int | None = None
    tracks: int | None = None
    begin: str | None = None
    facts: Mapping[str, Any] = field(default_factory=dict)
    outputs: tuple[Written, ...] = ()
    warnings: tuple[str, ...] = ()
    error: str | None = None
    program: str = f"vdet {__version__}"

    @property
    def is_doubtful(self) -> bool:
        """Whether a result may be wrong."""
        findings = self.facts.get(CONDITIONS, ())
        return any(finding["severity"] == "warning" for finding in findings)

    @property
    def line(self) -> str:
        """The line of the manifest."""
        return json.dumps(asdict(self), allow_nan=False) + "\n"


def note_path(folder: Path, path: Path) -> Path:
    """Return the path of the note about the run with this first output."""
    name = hashlib.sha256(os.fsencode(path.absolute())).hexdigest()
    return folder / _NOTES / f"{name[:32]}.json"


def read_records(*paths: Path) -> Iterator[Record]:
    """Yield the records in some files; missing files and invalid records are skipped.

    Raises
    ------
    OutputError
        A file cannot be read.
    """
    for path in filter(os.path.lexists, paths):
        with output_errors(path), os.fdopen(os.open(path, os.O_RDONLY | _FLAGS), "rb") as file:
            for text in file:
                with suppress(ValueError, TypeError, KeyError):
                    line = json.loads(text)
                    outputs = tuple(Written(**item) for item in line["outputs"])
                    yield Record(**{**line, "outputs": outputs})


def read_batch(folder: Path) -> Iterator[Record]:
    """Yield the records of all batches in a folder, in order. Errors as for `read_records`."""
    return read_records(folder / MANIFEST, *_notes(folder))


def _notes(folder: Path) -> list[Path]:
    return sorted((folder / _NOTES).glob("*.json"))


@contextmanager
def open_manifest(folder: Path) -> Iterator[Callable[[Record], None]]:
    """Yield a function that appends a record to the manifest and syncs it to disk.

    The manifest is locked: no other batch can write into the folder until the block ends. Notes
    left by an earlier batch are moved into it.

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
            message = f"{path}: another batch is writing here; wait, or use another folder"
            raise OutputError(message) from None
        with output_errors(path):
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - 1))
            if file.read() not in (b"", b"\n"):
                file.write(b"\n")  # a power cut left half a line

        def add(record: Record) -> None:
            with output_errors(path):
                end = file.seek(0, os.SEEK_END)
                if file.write(record.line.encode()) != len(record.line):
                    file.truncate(end)  # half a line would spoil the next one
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(descriptor)
            if record.outputs:
                note_path(folder, Path(record.outputs[0].path)).unlink(missing_ok=True)

        for note in _notes(folder):
            for record in read_records(note):
                add(record)
        try:
            yield add
        finally:
            remove_stale(folder / _NOTES)
            with suppress(OSError):  # a worker of an earlier batch may still write into it
                (folder / _NOTES).rmdir()
