"""The manifest: a line of JSON for every file of a batch, added as soon as the file is done.

The worker writes the record of a file as a note into a hidden folder of the batch, just before the
outputs are renamed. The note moves into the manifest when the file is done; if the batch is
interrupted, when it ends, and if it is killed, when the next one ends. So a batch never has outputs
without their record.
"""

import errno
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from vdet.errors import OutputError
from vdet.files import json_line, lock, output_errors, remove_stale
from vdet.run.result import FINDINGS
from vdet.version import __version__

MANIFEST = "manifest.jsonl"
_NOTES = ".vdet-notes"


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
class ManifestRecord:
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
        Results of steps about the whole video, by name.
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
        findings = self.facts.get(FINDINGS, ())
        return any(finding["severity"] == "warning" for finding in findings)

    @property
    def line(self) -> str:
        """The line of the manifest."""
        return json_line(asdict(self))


def note_path(folder: Path, path: Path) -> Path:
    """Return the path of the note about the run with this first output."""
    name = hashlib.sha256(os.fsencode(path.absolute())).hexdigest()
    return folder / _NOTES / f"{name[:32]}.json"


def read_records(*paths: Path) -> Iterator[ManifestRecord]:
    """Yield the records in some files; missing files and invalid records are skipped.

    Raises
    ------
    OutputError
        A file cannot be read.
    """
    for path in paths:
        with output_errors(path), suppress(FileNotFoundError), path.open("rb") as file:
            for line in file:
                with suppress(ValueError, TypeError, KeyError, RecursionError):
                    values = json.loads(line)
                    outputs = tuple(Written(**output) for output in values["outputs"])
                    yield ManifestRecord(**{**values, "outputs": outputs})


def read_batch(folder: Path) -> Iterator[ManifestRecord]:
    """Yield the records of all batches in a folder, in order. Errors as for `read_records`."""
    return read_records(folder / MANIFEST, *_notes(folder))


def _notes(folder: Path) -> list[Path]:
    return sorted((folder / _NOTES).glob("*.json"))


@contextmanager
def open_manifest(folder: Path) -> Iterator[Callable[[ManifestRecord], None]]:
    """Yield a function that appends a record to the manifest and syncs it to disk.

    The manifest is locked: no other batch can write into the folder until the block ends. At the
    end, notes of an interrupted or earlier batch are moved into it.

    Raises
    ------
    OutputError
        The file cannot be written (from the function, too), or another batch has locked it.
    """
    path = folder / MANIFEST
    with output_errors(path):
        file = path.open("a+b", buffering=0)
    with file:
        try:
            lock(file.fileno())
        except BlockingIOError:
            message = f"{path}: another batch is writing here; wait, or use another folder"
            raise OutputError(message) from None

        def append(line: str) -> None:
            with output_errors(path):
                if file.write(line.encode()) < len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(file.fileno())

        def add(record: ManifestRecord) -> None:
            append(record.line)
            if record.outputs:
                note_path(folder, Path(record.outputs[0].path)).unlink(missing_ok=True)

        if not _ends_with_whole_line(file):
            append("\n")  # a power cut or a full disk left half a line
        try:
            yield add
        finally:
            for record in read_records(*_notes(folder)):
                add(record)
            remove_stale(folder / _NOTES)
            with suppress(OSError):  # a worker of an earlier batch may still write into it
                (folder / _NOTES).rmdir()


def _ends_with_whole_line(file: BinaryIO) -> bool:
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - 1))
    return file.read(1) in (b"", b"\n")
