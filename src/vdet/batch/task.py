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
from vdet.run.video import VideoJob, run_video
from vdet.version import __version__

_SEARCH = {"input", "detector", "tracker", "regions", "steps"}
"""The sections of the settings that tracks depend on."""

_READ_BY = {"tracks": set[str](), "counts": {"counts"}, "flows": {"counts"}, "crops": set[str]()}
"""The sections that a sink reads too. Another sink may read all but `train` and `labels`."""


@dataclass(frozen=True, slots=True)
class Work:
    """What every video of a batch is processed with; workers load the model themselves.

    Attributes
    ----------
    model
        A model file; None for the shipped one, or for a detector without one.
    threads
        Number of threads of search, decoder and encoder of each video; None for one per core.
    digest
        SHA-256 of program, model and settings, and of the part and lanes that are wanted.
    model_name, model_sha256
        Name and SHA-256 of the model file; None for a detector without one.
    """

    settings: Settings
    model: Path | None = None
    threads: int | None = None
    digest: str = ""
    model_name: str | None = None
    model_sha256: str | None = None

    @classmethod
    def of(
        cls,
        job: VideoJob,
        sinks: Iterable[str],
        settings: Settings,
        model: Path | None,
        threads: int | None,
    ) -> Self:
        """Return the work of jobs that differ from `job` in their input and outputs only.

        Its paths are absolute: processes on other machines work in other folders.

        Raises
        ------
        ConfigError, ModelError
            The detector cannot be loaded.
        """
        load_detector(settings.detector, model)
        file, mask = model_file(settings.detector, model), settings.regions.mask
        sha256 = _digest_of(file) or None
        # What decides in still pictures only does not count.
        shown = settings.model_copy(update={"detector": settings.detector.showing_all()})
        wanted = (
            *(f"vdet {__version__}", sha256, job.start, job.end, job.frames, job.lanes),
            *(job.begin, job.interval, job.ground),
            _digest_of(mask),
            shown.model_dump_json(include=_sections(sinks, with_lanes=job.lanes is not None)),
        )
        if mask:
            regions = settings.regions.model_copy(update={"mask": str(Path(mask).absolute())})
            settings = settings.model_copy(update={"regions": regions})
        digest, name = _digest(*map(repr, wanted)), file.name if file else None
        return cls(settings, model and model.absolute(), threads, digest, name, sha256)


def _sections(sinks: Iterable[str], *, with_lanes: bool) -> set[str]:
    """Return the sections of the settings that outputs depend on."""
    all_of_them = set(Settings.model_fields) - {"train", "labels"}
    found = _SEARCH.union(*(_READ_BY.get(sink, all_of_them) for sink in sinks))
    return found | {"lanes"} if with_lanes else found - {"lanes"}


def result_digest(work: str, source: Path) -> str:
    """Return a digest of all that the result for an input depends on.

    Parameters
    ----------
    work
        The digest of the `Work`.
    source
        The input. It counts by its size and the time of its last change; numbered pictures count by
        those of all files in their folder.
    """
    states = []
    with suppress(OSError):  # there is no such input; reading it is an error soon
        states = [(file.name, file.stat()) for file in _files(source)]
    return _digest(work, *(repr((name, s.st_size, s.st_mtime_ns)) for name, s in states))


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


def process_file(job: VideoJob, *, work: Work) -> Record:
    """Run a job, and return its record.

    Errors are recorded, and not raised.
    """
    began, record = time.perf_counter(), _record(job, work)
    digest = result_digest(work.digest, job.source)
    with _collected_warnings(job) as warnings:
        try:
            record = replace(record, digest=digest, **_run(job, work))
        except Exception as failure:
            record = replace(record, error=in_one_line(failure))
            if os.environ.get("VDET_DEBUG") == "1":
                traceback.print_exc()
    seconds = round(time.perf_counter() - began, 3)
    return replace(record, seconds=seconds, warnings=tuple(warnings))


def record_of_killed(job: VideoJob, work: Work) -> Record:
    """Return the record of a job whose process was killed each time."""
    error = f"{job.source}: its process was killed, or crashed; there may be too little memory"
    return replace(_record(job, work), error=error)


def _run(job: VideoJob, work: Work) -> dict[str, Any]:
    """Run a job, and return what its record says about the result."""
    job = replace(job, threads=work.threads, codec_threads=work.threads)
    chosen = pickle.dumps((work.settings.detector, work.model))  # settings may be unhashable
    model = _kept_detector(chosen, work.model_sha256)
    totals = run_video(job, model, work.settings)
    states = {str(each.path.absolute()): output_state(each) or (0, 0) for each in job.outputs}
    return {
        **{name: getattr(totals, name) for name in ("width", "height", "frames", "tracks")},
        "begin": str(totals.clock) if totals.clock else None,
        "sizes": {path: size for path, (size, _) in states.items()},
        "times": {path: changed for path, (_, changed) in states.items()},
    }


@lru_cache(maxsize=1)
def _kept_detector(chosen: bytes, _sha256: str | None) -> DetectorModel:
    """Load a detector, which this process keeps for the next videos; the file may not change."""
    return load_detector(*pickle.loads(chosen))


def _record(job: VideoJob, work: Work) -> Record:
    """Return the record of a job that begins now."""
    paths: dict[str, tuple[str, ...]] = {}
    for output in job.outputs:
        paths[output.sink] = (*paths.get(output.sink, ()), str(output.path.absolute()))
    outputs = {sink: each[0] if len(each) == 1 else each for sink, each in paths.items()}
    source, now = str(job.source.absolute()), datetime.now(UTC).isoformat(timespec="seconds")
    model = work.model_name
    return Record(source, outputs, now, 0.0, model=model, model_sha256=work.model_sha256)


@contextmanager
def _collected_warnings(job: VideoJob) -> Iterator[list[str]]:
    """Give a list of the warnings about a job; other threads may log about other files."""
    prefixes = tuple(f"{path}: " for path in (job.source, *(each.path for each in job.outputs)))
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
