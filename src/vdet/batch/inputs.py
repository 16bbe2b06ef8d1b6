"""The videos of a batch, from files, folders and patterns."""

import glob
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from vdet.errors import BatchError

VIDEO_INPUT_SUFFIXES = frozenset((
    ".264", ".265", ".3g2", ".3gp", ".asf", ".avi", ".dav", ".dv", ".f4v", ".flv", ".h264", ".h265",
    ".hevc", ".insv", ".m2t", ".m2ts", ".m2v", ".m4v", ".mjpeg", ".mjpg", ".mkv", ".mov", ".mp4",
    ".mpeg", ".mpg", ".mts", ".mxf", ".ogv", ".ts", ".vob", ".webm", ".wmv", ".y4m",
))  # fmt: skip
"""Suffixes of videos in a folder. A file that is named may have any suffix."""


@dataclass(frozen=True, slots=True)
class Source:
    """A video, and its `place`: its path below the folder or the pattern that it was found by."""

    path: Path
    place: Path


def find_sources(clips: Sequence[Path]) -> list[Source]:
    """Return the videos of `clips`, each once.

    Each clip is one of these, and its videos are in the order of their names:

    * a file;
    * a folder: the videos in it and below it, without hidden files and folders;
    * a pattern with ``*``, ``?`` or ``[``, where ``**`` means any folders: the files that match,
      and the videos in the folders that match. Their places are below the last folder of the
      pattern that has no such character.

    Raises
    ------
    BatchError
        One of `clips` gives no video, or a folder cannot be read.
    """
    found: dict[tuple[Path, Path], Source] = {}
    for clip in clips:
        sources = sorted(_videos_of(clip), key=lambda source: source.place)
        if not sources:
            raise BatchError(f"{clip}: {_reason(clip)}")
        for source in sources:
            found.setdefault((source.path.resolve(), source.place), source)
    return list(found.values())


def _videos_of(clip: Path) -> Iterable[Source]:
    if clip.is_dir():
        return _below(clip, clip)
    if clip.exists() or not glob.has_magic(str(clip)):
        return [Source(clip, Path(clip.name))] if clip.exists() else []
    return _matching(clip)


def _matching(pattern: Path) -> Iterator[Source]:
    plain = [parent for parent in pattern.parents if not glob.has_magic(str(parent))]
    for name in glob.glob(str(pattern), recursive=True):  # noqa: PTH207  # Path.glob cannot start at /
        path = Path(name)
        if path.is_dir():
            yield from _below(path, plain[0])
        else:
            yield Source(path, path.relative_to(plain[0]))


def _below(folder: Path, base: Path) -> Iterator[Source]:
    for root, folders, names in os.walk(folder, onerror=_refuse_unreadable):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in names:
            path = Path(root, name)
            if path.suffix.lower() in VIDEO_INPUT_SUFFIXES and not name.startswith("."):
                yield Source(path, path.relative_to(base))


def _refuse_unreadable(error: OSError) -> None:
    raise BatchError(f"{error.filename}: cannot be read: {error.strerror}; leave it out") from error


def _reason(clip: Path) -> str:
    """Say why a clip gives no video."""
    if clip.is_dir():
        return "there is no video in this folder or below it; name the files"
    if glob.has_magic(str(clip)):
        return "no file matches this pattern; check it"
    return "there is no such file; check the name"
