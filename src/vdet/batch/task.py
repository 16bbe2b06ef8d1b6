"""One file of a batch: what its result depends on, whether it is done, and its record."""

import hashlib
import logging
import os
import pickle
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path

from vdet.batch.manifest import Record, Written, read_records, written_outputs
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector, model_file
from vdet.detect.protocol import DetectorModel
from vdet.errors import BatchError, in_one_line
from vdet.files import OutputFiles, recorded_inputs
from vdet.run.sinks.protocol import output_state
from vdet.run.video import Run, write_outputs
from vdet.version import __version__
from vdet.workers import limit_library_threads

_SEARCH = {"input", "camera", "detector", "tracker", "regions", "steps", "lanes"}
"""The sections of the settings that tracks depend on."""

_READ_BY = {"tracks": set[str](), "counts": {"traffic"}, "flows": {"traffic"}, "crops": set[str]()}
"""The sections that a sink reads too. Another sink may read all but `train` and `labels`."""


def result_digest(run: Run) -> str:
    """Return a digest of all that the outputs of a run depend on.

    These are the program, the files of model and masks, the settings that the sinks read, the part,
    the time zone of this computer, and the size and the time of the input; numbered pictures count
    by those of all files in their folder.
    """
    settings = run.settings
    # What decides in still pictures only does not count, nor where the model file lies.
    detector = settings.detector.showing_all().model_copy(update={"model": None})
    shown = settings.model_copy(update={"detector": detector})
    rest = set(Settings.model_fields) - {"train", "labels"}
    sections = _SEARCH.union(*(_READ_BY.get(output.sink, rest) for output in run.outputs))
    files = model_file(settings.detector), *(each.mask for each in settings.regions)
    wanted = (
        *(f"vdet {__version__}", run.start, run.end, run.frames, time.timezone, time.tzname),
        *(_digest_of(file) for file in files),
        *((file.name, stat.st_size, stat.st_mtime_ns) for file, stat in _states(run.source)),
        shown.model_dump_json(include=sections),
    )
    return hashlib.sha256("\0".join(map(repr, wanted)).encode()).hexdigest()


def _states(source: Path) -> list[tuple[Path, os.stat_result]]:
    folder = source if source.is_dir() else source.parent
    with suppress(OSError):  # there is no such input; reading it is an error soon
        files = [source] if source.is_file() else sorted(folder.iterdir())
        return [(file, file.stat()) for file in files]
    return []


def _digest_of(path: Path | str | None) -> str | None:
    """Return the SHA-256 of a file; None where there is none."""
    with suppress(OSError):
        return _kept_digest(str(path), os.stat(path).st_mtime_ns) if path else None  # noqa: PTH116
    return None


@lru_cache(maxsize=16)
def _kept_digest(path: str, _changed: int) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def is_done(run: Run, written: Mapping[str, Sequence[Written]]) -> bool:
    """Return whether the outputs of a run have their sizes, and were made as it would make them."""
    digest = result_digest(run)
    for output in run.outputs:
        state, known = output_state(output), written.get(os.path.realpath(output.path))
        if not (state and known) or (known[-1].digest, known[-1].state[0]) != (digest, state[0]):
            return False
    return True


def replacing_ours(run: Run, written: Mapping[str, Sequence[Written]]) -> Run:
    """Return a run that replaces its outputs, where vdet wrote all of them that exist.

    Raises
    ------
    BatchError
        One exists that has another size or time than all records say, and is not empty.
    """
    for output in run.outputs:
        state, known = output_state(output), written.get(os.path.realpath(output.path), ())
        if state and state[0] and state not in {each.state for each in known}:
            raise BatchError(f"{output.path}: is not as vdet wrote it; remove it, or --overwrite")
    return replace(run, overwrite=any(os.path.lexists(output.path) for output in run.outputs))


@recorded_inputs()
def process_file(run: Run, *, folder: Path) -> Record:
    """Process a video, and return its record, which is left as a note in the folder of the batch.

    Errors are recorded, and not raised. It can be called again where its process was killed: then
    the outputs are made again, or else were complete.
    """
    limit_library_threads()
    began, record = time.perf_counter(), new_record(run)
    with _collected_warnings(run) as warnings:
        try:
            record = _process(run, record, folder, warnings)
        except Exception as failure:
            if os.environ.get("VDET_DEBUG") == "1":
                traceback.print_exc()
            record.note(folder).unlink(missing_ok=True)
            seconds = round(time.perf_counter() - began, 3)
            error = in_one_line(failure)
            record = replace(record, error=error, seconds=seconds, warnings=tuple(warnings))
    return record


def _process(run: Run, record: Record, folder: Path, warnings: Sequence[str]) -> Record:
    for earlier in read_records(record.note(folder)):
        written = written_outputs([earlier])
        if is_done(run, written):
            return earlier
        run = run if run.overwrite else replacing_ours(run, written)
    digest = result_digest(run)
    chosen = pickle.dumps(run.settings.detector)  # settings of other packages may be unhashable
    with OutputFiles(overwrite=run.overwrite) as files:
        totals = write_outputs(run, _kept_detector(chosen, record.model_sha256), files)
        states = {
            str(output.path.absolute()): output_state(output, files.place_of(output.path)) or (0, 0)
            for output in run.outputs
        }
        done = replace(
            record,
            seconds=round(totals.seconds, 3),
            **{name: getattr(totals, name) for name in ("width", "height", "frames", "tracks")},
            begin=str(totals.clock) if totals.clock else None,
            warnings=tuple(warnings),
            digest=digest,
            sizes={path: size for path, (size, _) in states.items()},
            times={path: changed for path, (_, changed) in states.items()},
            facts={name: fact.record() for name, fact in totals.facts.items()},
            summaries={str(Path(path).absolute()): x for path, x in totals.summaries.items()},
        )
        done.leave_note(folder)
    return done


@lru_cache(maxsize=1)
def _kept_detector(chosen: bytes, _sha256: str | None) -> DetectorModel:
    """Load a detector, which this process keeps for the next videos; the file may not change."""
    return load_detector(pickle.loads(chosen))


def new_record(run: Run) -> Record:
    """Return the record of a run that begins now."""
    paths: dict[str, tuple[str, ...]] = {}
    for output in run.outputs:
        paths[output.sink] = (*paths.get(output.sink, ()), str(output.path.absolute()))
    outputs = {sink: some[0] if len(some) == 1 else some for sink, some in paths.items()}
    source, now = str(run.source.absolute()), datetime.now(UTC).isoformat(timespec="seconds")
    model = model_file(run.settings.detector)
    name = model.name if model else None
    return Record(source, outputs, now, 0.0, model=name, model_sha256=_digest_of(model))


@contextmanager
def _collected_warnings(run: Run) -> Iterator[list[str]]:
    """Give a list of the warnings about a run; other threads may log about other files.

    They are not printed here: whoever gets the record prints them.
    """
    prefixes = tuple(f"{path}: " for path in (run.source, *(each.path for each in run.outputs)))
    messages: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        message = record.getMessage()
        is_ours = record.levelno >= logging.WARNING and message.startswith(prefixes)
        if is_ours:
            messages.append(message)
        return not is_ours

    log = logging.getLogger("vdet")
    log.addFilter(collect)
    try:
        yield messages
    finally:
        log.removeFilter(collect)
