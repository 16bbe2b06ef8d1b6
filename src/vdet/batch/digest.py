"""What a result depends on, as a digest: a result whose digest differs is out of date."""

import contextlib
import hashlib
from pathlib import Path

from vdet.batch.manifest import Origin
from vdet.config.schema import Settings
from vdet.run.video import VideoJob

_NO_EFFECT = {"train"}  # sections that detection does not read


def work_digest(origin: Origin, settings: Settings, job: VideoJob) -> str:
    """Return a digest of program, model and settings, and of the part and lanes that are wanted."""
    wanted = (
        *(origin.program, origin.model_sha256, job.start, job.end, job.frames, job.lanes),
        _content_digest(settings.regions.mask),
    )
    return _digest(repr(wanted), settings.model_dump_json(exclude=_NO_EFFECT))


def _content_digest(path: str | None) -> str:
    """Return a digest of a file; nothing where there is none."""
    with contextlib.suppress(OSError):
        return hashlib.sha256(Path(path).read_bytes()).hexdigest() if path else ""
    return ""


def result_digest(work: str, source: Path) -> str:
    """Return a digest of all that the result for an input depends on.

    Parameters
    ----------
    work
        From `work_digest`.
    source
        The input. It counts by its size and the time of its last change; numbered pictures count by
        those of all files in their folder.
    """
    states = []
    with contextlib.suppress(OSError):  # there is no such input; reading it is an error soon
        states = [(file.name, file.stat()) for file in _files(source)]
    return _digest(work, *(repr((name, s.st_size, s.st_mtime_ns)) for name, s in states))


def _files(source: Path) -> list[Path]:
    if source.is_file():
        return [source]
    return sorted((source if source.is_dir() else source.parent).iterdir())


def _digest(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode("utf-8", "surrogateescape")).hexdigest()
