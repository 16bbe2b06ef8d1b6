"""One file of a batch: process it, and say what became of it, whatever happens."""

import logging
import os
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from vdet.batch.manifest import Record
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector
from vdet.errors import in_one_line
from vdet.files import make_folder
from vdet.pipeline.loop import Summary, VideoJob, run_video


@dataclass(frozen=True, slots=True)
class Work:
    """What every video of a batch is processed with; a worker loads the model by itself.

    `model` is a model file, None for a detector without one. `threads` are those of the search, of
    the decoder and of the encoder of each video.
    """

    settings: Settings
    model: Path | None
    threads: int


def process_file(job: VideoJob, *, work: Work) -> Record:
    """Run a job, make the folders that it needs, and return its record; no error gets out."""
    began, started = time.perf_counter(), _now()
    summary, error = None, None
    threads = work.threads
    with _warnings_of(job) as warnings:
        try:
            for output in job.outputs:
                make_folder(output.path.parent)
            model = load_detector(work.settings.detector, work.model)
            summary = run_video(job, model, work.settings, threads=threads, codec_threads=threads)
        except Exception as failure:
            error = in_one_line(failure)
            if os.environ.get("VDET_DEBUG") == "1":
                traceback.print_exc()
    seconds = time.perf_counter() - began
    return _record(job, started, seconds, summary=summary, warnings=tuple(warnings), error=error)


def record_of_killed(job: VideoJob) -> Record:
    """Return the record of a job whose process was killed, also when nothing else ran beside it."""
    error = f"{job.source}: its process was killed, or crashed; there may be too little memory"
    return _record(job, _now(), 0.0, error=error)


def _record(
    job: VideoJob,
    started: str,
    seconds: float,
    *,
    error: str | None,
    summary: Summary | None = None,
    warnings: tuple[str, ...] = (),
) -> Record:
    record = Record(
        input=str(job.source.absolute()),
        outputs={output.sink: str(output.path.absolute()) for output in job.outputs},
        started=started,
        seconds=round(seconds, 3),
        warnings=warnings,
        error=error,
    )
    if summary is None:
        return record
    return replace(
        record,
        width=summary.width,
        height=summary.height,
        frames=summary.frames,
        tracks=summary.tracks,
    )


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


class _Collector(logging.Handler):
    """Keeps the warnings that name one of `paths`: threads of this process may do other files."""

    def __init__(self, paths: Sequence[Path], messages: list[str]) -> None:
        super().__init__(logging.WARNING)
        self._beginnings = tuple(f"{path}: " for path in paths)
        self._messages = messages

    def emit(self, record: logging.LogRecord) -> None:
        message = record.getMessage()
        if message.startswith(self._beginnings):
            self._messages.append(message)


@contextmanager
def _warnings_of(job: VideoJob) -> Iterator[list[str]]:
    messages: list[str] = []
    collector = _Collector([job.source, *(each.path for each in job.outputs)], messages)
    log = logging.getLogger("vdet")
    log.addHandler(collector)
    try:
        yield messages
    finally:
        log.removeHandler(collector)
