"""One file of a batch: process it, and return its record."""

import logging
import os
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from vdet.batch.digest import result_digest
from vdet.batch.manifest import Record
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector
from vdet.errors import in_one_line
from vdet.progress import Progress, no_progress
from vdet.run.sinks.protocol import make_folders, output_size
from vdet.run.video import VideoJob, run_video


@dataclass(frozen=True, slots=True)
class Work:
    """What every video of a batch is processed with; workers load the model themselves.

    Attributes
    ----------
    model
        A model file; None for the shipped one, or for a detector without one.
    threads
        Of the search, of the decoder and of the encoder of each video.
    digest
        From `work_digest`, for the records.
    """

    settings: Settings
    model: Path | None
    threads: int
    digest: str = ""


def process_file(job: VideoJob, *, work: Work, progress: Progress = no_progress) -> Record:
    """Make the folders of a job's outputs, run it, and return its record.

    Errors are recorded, and not raised. `progress` is as `run_video` takes it.
    """
    began, started = time.perf_counter(), _now()
    summary, error = None, None
    sizes: dict[str, int] = {}
    digest = result_digest(work.digest, job.source)
    threads = work.threads
    with _collected_warnings(job) as warnings:
        try:
            for output in job.outputs:
                make_folders(output)
            model = load_detector(work.settings.detector, work.model)
            summary = run_video(
                job,
                model,
                work.settings,
                threads=threads,
                codec_threads=threads,
                progress=progress,
            )
            for output in job.outputs:
                sizes[str(output.path.absolute())] = output_size(output) or 0
        except Exception as failure:
            error = in_one_line(failure)
            for output in job.outputs:
                with suppress(OSError):
                    output.path.rmdir()  # only a folder, and only if it is empty
            if os.environ.get("VDET_DEBUG") == "1":
                traceback.print_exc()
    seconds = time.perf_counter() - began
    record = _record(job, started, seconds, warnings=tuple(warnings), error=error)
    if summary is None or error:
        return record
    return replace(
        record,
        width=summary.width,
        height=summary.height,
        frames=summary.frames,
        tracks=summary.tracks,
        digest=digest,
        sizes=sizes,
    )


def record_of_killed(job: VideoJob) -> Record:
    """Return the record of a job whose process was killed each time."""
    error = f"{job.source}: its process was killed, or crashed; there may be too little memory"
    return _record(job, _now(), 0.0, error=error)


def _record(
    job: VideoJob,
    started: str,
    seconds: float,
    *,
    error: str | None,
    warnings: tuple[str, ...] = (),
) -> Record:
    return Record(
        input=str(job.source.absolute()),
        outputs=_paths_by_sink(job),
        started=started,
        seconds=round(seconds, 3),
        warnings=warnings,
        error=error,
    )


def _paths_by_sink(job: VideoJob) -> dict[str, str | tuple[str, ...]]:
    paths: dict[str, tuple[str, ...]] = {}
    for output in job.outputs:
        paths[output.sink] = (*paths.get(output.sink, ()), str(output.path.absolute()))
    return {sink: each[0] if len(each) == 1 else each for sink, each in paths.items()}


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


class _WarningCollector(logging.Handler):
    """Keeps the warnings about `paths`; other threads of the process may log about other files."""

    def __init__(self, paths: Sequence[Path], messages: list[str]) -> None:
        super().__init__(logging.WARNING)
        self._prefixes = tuple(f"{path}: " for path in paths)
        self._messages = messages

    def emit(self, record: logging.LogRecord) -> None:
        message = record.getMessage()
        if message.startswith(self._prefixes):
            self._messages.append(message)


@contextmanager
def _collected_warnings(job: VideoJob) -> Iterator[list[str]]:
    messages: list[str] = []
    collector = _WarningCollector([job.source, *(each.path for each in job.outputs)], messages)
    log = logging.getLogger("vdet")
    log.addHandler(collector)
    try:
        yield messages
    finally:
        log.removeHandler(collector)
