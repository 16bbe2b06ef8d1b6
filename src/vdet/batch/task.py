"""One file of a batch: the digest of its result, whether it is done, and its record.

The manifest has a line of JSON for every file, added as soon as the file is done. The worker writes
the record of a file as a note into a hidden folder of the batch, just before the outputs are
renamed. The note moves into the manifest when the file is done; if the batch is interrupted, when
it ends, and if it is killed, when the next one ends. So a batch never has outputs without their
record.
"""

import errno
import hashlib
import json
import logging
import os
import pickle
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO

from vdet.detect.detectors import DetectorModel, load_detector, model_file
from vdet.errors import BatchError, OutputError, in_one_line
from vdet.files import OutputFiles, json_line, lock, output_errors, remove_stale, write_whole
from vdet.media.images import numbered_images
from vdet.plugins import plugin_packages
from vdet.run.loop import Parts
from vdet.run.result import FINDINGS
from vdet.run.sinks.protocol import output_state, sink_kind
from vdet.run.video import Run, write_outputs
from vdet.version import __version__
from vdet.workers import limit_library_threads

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


WrittenByPath = Mapping[str, Sequence[Written]]
"""Written outputs by their real paths; the latest is last."""


def result_digest(run: Run) -> str:
    """Return a digest of everything that the outputs of a run depend on.

    This is the program, packages with plug-ins, the model, the settings, the part, the time zone of
    this computer, and the name, size and time of the input, of all numbered images, of the masks
    and of the picture.
    """
    settings = run.settings
    shown = (*(region.mask for region in settings.regions), settings.survey.picture)
    images = (Path(name) for name in shown if name)
    files = filter(Path.exists, (*(numbered_images(run.source) or [run.source]), *images))
    parts = (
        *(f"vdet {__version__}", run.start, run.end, run.frames, time.timezone, time.tzname),
        *plugin_packages(),
        _sha256(model_file(settings.detector)),
        *((file.name, file.stat().st_size, file.stat().st_mtime_ns) for file in files),
        settings.with_paths(lambda _: "").model_dump_json(
            exclude={"train": True, "labels": True, "detector": {"model"}}
        ),
    )
    return hashlib.sha256("\0".join(map(repr, parts)).encode()).hexdigest()


def _sha256(path: Path | None) -> str | None:
    """Return the SHA-256 of a file; None if it does not exist."""
    with suppress(OSError):
        if path:
            state = path.stat()
            return _cached_sha256(path, state.st_ino, state.st_mtime_ns, state.st_size)
    return None


@lru_cache(maxsize=16)
def _cached_sha256(path: Path, *_state: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def outputs_by_path(records: Iterable[ManifestRecord]) -> WrittenByPath:
    """Return the outputs in some records."""
    outputs: dict[str, list[Written]] = {}
    for record in records:
        for output in record.outputs:
            outputs.setdefault(os.path.realpath(output.path), []).append(output)
    return outputs


def is_up_to_date(run: Run, written: WrittenByPath) -> bool:
    """Return whether the outputs of a run have their recorded sizes and the current digest."""
    digest = result_digest(run)
    for output in run.outputs:
        size, _ = output_state(output) or (None, None)
        latest = written.get(os.path.realpath(output.path), [None])[-1]
        if size is None or latest is None or (latest.digest, latest.bytes) != (digest, size):
            return False
    return True


def allow_replacing(run: Run, written: WrittenByPath) -> Run:
    """Return a run that may replace its outputs, if vdet wrote all that exist.

    Raises
    ------
    BatchError
        A non-empty output has a size or time that is not in any record.
    """
    for output in run.outputs:
        state, versions = output_state(output), written.get(os.path.realpath(output.path), ())
        if state and state[0] and state not in {(item.bytes, item.changed) for item in versions}:
            raise BatchError(f"{output.path}: has changed since vdet wrote it", field="overwrite")
    return replace(run, overwrite=any(os.path.lexists(output.path) for output in run.outputs))


def process_file(run: Run, *, folder: Path) -> ManifestRecord:
    """Process a video, and return its record, which is also written as a note into the folder.

    Errors are recorded, not raised. After its process was killed, it can be called again: the
    outputs are made again unless they were complete.
    """
    limit_library_threads()
    began, record = time.perf_counter(), new_record(run)
    note = note_path(folder, run.outputs[0].path)
    with _collected_warnings() as warnings:
        try:
            for earlier in read_records(note):
                written = outputs_by_path([earlier])
                if is_up_to_date(run, written):
                    return earlier
                run = run if run.overwrite else allow_replacing(run, written)
            with OutputFiles(overwrite=run.overwrite, inputs=run.inputs) as files:
                record = replace(_written(run, record, files), warnings=tuple(warnings))
                write_whole(note, record.line, overwrite=True)
        except Exception as failure:
            note.unlink(missing_ok=True)
            seconds, error = round(time.perf_counter() - began, 3), in_one_line(failure)
            return replace(new_record(run), seconds=seconds, error=error, warnings=tuple(warnings))
    return record


def _written(run: Run, record: ManifestRecord, files: OutputFiles) -> ManifestRecord:
    """Write the outputs, still under temporary names, and return their record."""
    digest = result_digest(run)
    detector = pickle.dumps(run.settings.detector)  # settings of other packages may be unhashable
    totals = write_outputs(run, files, Parts(_cached_detector(detector, record.model_sha256)))
    written = []
    for output in run.outputs:
        size, changed = output_state(output, files.staged_path(output.path)) or (0, 0)
        path = str(output.path.absolute())
        summary = totals.summaries[output.path] if sink_kind(output.sink).total else None
        written.append(Written(output.sink, path, size, changed, digest, summary))
    return replace(
        record,
        seconds=round(totals.seconds, 3),
        width=totals.width,
        height=totals.height,
        frames=totals.frames,
        tracks=totals.tracks,
        begin=str(totals.clock) if totals.clock else None,
        facts={name: fact.record() for name, fact in totals.facts.items()},
        outputs=tuple(written),
    )


@lru_cache(maxsize=1)
def _cached_detector(settings: bytes, _model_sha256: str | None) -> DetectorModel:
    """Load a detector, and keep it for the next videos of this process."""
    return load_detector(pickle.loads(settings))


def new_record(run: Run) -> ManifestRecord:
    """Return the record of a run that starts now."""
    model = model_file(run.settings.detector)
    return ManifestRecord(
        input=str(run.source.absolute()),
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        model=model.name if model else None,
        model_sha256=_sha256(model),
    )


@contextmanager
def _collected_warnings() -> Iterator[list[str]]:
    """Yield a list of the warnings in the block; the receiver of the record prints them."""
    messages: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        if record.levelno == logging.WARNING:
            messages.append(record.getMessage())
        return record.levelno != logging.WARNING

    log = logging.getLogger("vdet")
    log.addFilter(collect)
    try:
        yield messages
    finally:
        log.removeFilter(collect)
