"""One file of a batch: what it is processed with, what its result depends on, and its record."""

import hashlib
import logging
import os
import pickle
import time
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

from vdet.batch.manifest import Record
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector, model_file
from vdet.detect.protocol import DetectorModel
from vdet.errors import in_one_line
from vdet.run.sinks.protocol import output_state
from vdet.run.video import Run, run_video
from vdet.version import __version__

_SEARCH = {"input", "camera", "detector", "tracker", "regions", "steps", "lanes"}
"""The sections of the settings that tracks depend on."""

_READ_BY = {"tracks": set[str](), "counts": {"traffic"}, "flows": {"traffic"}, "crops": set[str]()}
"""The sections that a sink reads too. Another sink may read all but `train` and `labels`."""


@dataclass(frozen=True, slots=True)
class Identity:
    """What the outputs of a batch depend on, beside each video.

    Attributes
    ----------
    digest
        SHA-256 of program, model and settings, and of the part that is wanted.
    model, model_sha256
        Name and SHA-256 of the model file; None for a detector without one.
    """

    digest: str
    model: str | None = None
    model_sha256: str | None = None

    @classmethod
    def of(cls, run: Run, sinks: Iterable[str]) -> Self:
        """Return the identity of runs that differ from `run` in their video and outputs only.

        Raises
        ------
        ConfigError, ModelError
            The detector cannot be loaded.
        """
        settings = run.settings
        load_detector(settings.detector)
        file = model_file(settings.detector)
        sha256 = _digest_of(file) or None
        # What decides in still pictures only does not count, nor where the model file lies.
        detector = settings.detector.showing_all().model_copy(update={"model": None})
        shown = settings.model_copy(update={"detector": detector})
        wanted = (
            *(f"vdet {__version__}", sha256, run.start, run.end, run.frames),
            *(_digest_of(each.mask) for each in settings.regions),
            shown.model_dump_json(include=_sections(sinks)),
        )
        return cls(_digest(*map(repr, wanted)), file.name if file else None, sha256)


def _sections(sinks: Iterable[str]) -> set[str]:
    """Return the sections of the settings that outputs depend on."""
    all_of_them = set(Settings.model_fields) - {"train", "labels"}
    return _SEARCH.union(*(_READ_BY.get(sink, all_of_them) for sink in sinks))


def result_digest(identity: Identity, source: Path) -> str:
    """Return a digest of all that the result for an input depends on.

    Parameters
    ----------
    identity
        That of the batch.
    source
        The input. It counts by its size and the time of its last change; numbered pictures count by
        those of all files in their folder.
    """
    states = []
    with suppress(OSError):  # there is no such input; reading it is an error soon
        states = [(file.name, file.stat()) for file in _files(source)]
    return _digest(identity.digest, *(repr((name, s.st_size, s.st_mtime_ns)) for name, s in states))


def _files(source: Path) -> list[Path]:
    if source.is_file():
        return [source]
    return sorted((source if source.is_dir() else source.parent).iterdir())


def _digest(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode("utf-8", "surrogateescape")).hexdigest()


def _digest_of(path: Path | str | None) -> str:
    """Return a digest of a file; nothing where there is none."""
    with suppress(OSError):
        return hashlib.sha256(Path(path).read_bytes()).hexdigest() if path else ""
    return ""


def process_file(run: Run, *, identity: Identity) -> Record:
    """Process a video, and return its record.

    Errors are recorded, and not raised.
    """
    began, record = time.perf_counter(), _record(run, identity)
    digest = result_digest(identity, run.source)
    with _collected_warnings(run) as warnings:
        try:
            record = replace(record, digest=digest, **_process(run, identity))
        except Exception as failure:
            record = replace(record, error=in_one_line(failure))
            if os.environ.get("VDET_DEBUG") == "1":
                traceback.print_exc()
    seconds = round(time.perf_counter() - began, 3)
    return replace(record, seconds=seconds, warnings=tuple(warnings))


def record_of_killed(run: Run, identity: Identity) -> Record:
    """Return the record of a run whose process was killed each time."""
    error = f"{run.source}: its process was killed, or crashed; there may be too little memory"
    return replace(_record(run, identity), error=error)


def _process(run: Run, identity: Identity) -> dict[str, Any]:
    """Process a video, and return what its record says about the result."""
    chosen = pickle.dumps(run.settings.detector)  # settings of other packages may be unhashable
    totals = run_video(run, _kept_detector(chosen, identity.model_sha256))
    states = {str(each.path.absolute()): output_state(each) or (0, 0) for each in run.outputs}
    return {
        **{name: getattr(totals, name) for name in ("width", "height", "frames", "tracks")},
        "conditions": tuple(each.record() for each in totals.findings),
        "begin": str(totals.clock) if totals.clock else None,
        "sizes": {path: size for path, (size, _) in states.items()},
        "times": {path: changed for path, (_, changed) in states.items()},
        "summaries": {
            str(Path(path).absolute()): summary for path, summary in totals.summaries.items()
        },
    }


@lru_cache(maxsize=1)
def _kept_detector(chosen: bytes, _sha256: str | None) -> DetectorModel:
    """Load a detector, which this process keeps for the next videos; the file may not change."""
    return load_detector(pickle.loads(chosen))


def _record(run: Run, identity: Identity) -> Record:
    """Return the record of a run that begins now."""
    paths: dict[str, tuple[str, ...]] = {}
    for output in run.outputs:
        paths[output.sink] = (*paths.get(output.sink, ()), str(output.path.absolute()))
    outputs = {sink: each[0] if len(each) == 1 else each for sink, each in paths.items()}
    source, now = str(run.source.absolute()), datetime.now(UTC).isoformat(timespec="seconds")
    model, sha256 = identity.model, identity.model_sha256
    return Record(source, outputs, now, 0.0, model=model, model_sha256=sha256)


@contextmanager
def _collected_warnings(run: Run) -> Iterator[list[str]]:
    """Give a list of the warnings about a run; other threads may log about other files."""
    prefixes = tuple(f"{path}: " for path in (run.source, *(each.path for each in run.outputs)))
    messages: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        message = record.getMessage()
        if record.levelno >= logging.WARNING and message.startswith(prefixes):
            messages.append(message)
        return True

    log = logging.getLogger("vdet")
    log.addFilter(collect)
    try:
        yield messages
    finally:
        log.removeFilter(collect)
