"""The videos of a batch, from files and folders."""

import logging
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from vdet.errors import BatchError, VideoError
from vdet.media.demux import reject_address
from vdet.media.images import IMAGE_SUFFIXES, numbered_images

_log = logging.getLogger("vdet")

VIDEO_INPUT_SUFFIXES = frozenset((
    ".264", ".265", ".3g2", ".3gp", ".asf", ".avi", ".dav", ".dv", ".f4v", ".flv", ".h264", ".h265",
    ".hevc", ".insv", ".m2t", ".m2ts", ".m2v", ".m4v", ".mjpeg", ".mjpg", ".mkv", ".mov", ".mp4",
    ".mpeg", ".mpg", ".mts", ".mxf", ".ogv", ".ts", ".vob", ".webm", ".wmv", ".y4m",
))  # fmt: skip
"""Suffixes of videos in a folder. A file passed by name may have any suffix."""

DRAWN = ".vdet"
"""Part before the suffix in the name of a video written beside its source."""


@dataclass(frozen=True, slots=True)
class InputVideo:
    """A video, and its path relative to the input folder."""

    path: Path
    relative_path: Path


def find_sources(clips: Sequence[Path]) -> list[InputVideo]:
    """Return the videos of `clips`, each once.

    Each clip is one of these, and the videos of a folder are in the order of their names:

    * a file, or numbered images such as ``img_%04d.png``;
    * a folder: the videos in it, recursively, without hidden files and folders. A folder that has
      numbered images and no videos is a video itself.

    Videos that vdet wrote beside their sources are skipped, unless they are passed by name.
    Folders of several kinds of images are skipped with a warning (logger "vdet").

    Raises
    ------
    BatchError
        One of `clips` has no video, or a folder cannot be read.
    VideoError
        One of `clips` is an address, or numbered images with a gap.
    """
    videos: dict[tuple[Path, Path], InputVideo] = {}
    for clip in clips:
        videos_of_clip = sorted(_videos_of(clip), key=lambda video: video.relative_path)
        if not videos_of_clip:
            raise BatchError(f"{clip}: no video found; check the name, without quoted patterns")
        for video in videos_of_clip:
            videos.setdefault((video.path.resolve(), video.relative_path), video)
    return list(videos.values())


def _videos_of(clip: Path) -> Iterable[InputVideo]:
    if clip.is_dir():
        return _below(clip, clip)
    if clip.exists():
        return [InputVideo(clip, Path(clip.name))]
    reject_address(clip)
    if numbered_images(clip):
        return [InputVideo(clip, Path(f"{clip.absolute().parent.name}{clip.suffix}"))]
    return []


def _below(folder: Path, base: Path) -> Iterator[InputVideo]:
    for root, folders, names in os.walk(folder, onerror=_reject_unreadable):
        folders[:] = [name for name in folders if not name.startswith(".")]
        videos = [path for name in names if _is_video(path := Path(root, name))]
        for path in videos:
            yield InputVideo(path, path.relative_to(base))
        suffixes = {Path(name).suffix.lower() for name in names if not name.startswith(".")}
        if not videos and suffixes & IMAGE_SUFFIXES:
            yield from _images_in(Path(root), base)


def _images_in(folder: Path, base: Path) -> Iterator[InputVideo]:
    """Yield the numbered images of a folder as one video, with the name of the folder."""
    try:
        images = numbered_images(folder)
    except VideoError as error:
        _log.warning("%s; skipped", error)
        return
    named = Path(folder.absolute().name) if folder == base else folder.relative_to(base)
    yield InputVideo(folder, named.with_name(f"{named.name}{images[0].suffix}"))


def _is_video(path: Path) -> bool:
    is_skipped = path.name.startswith(".") or path.stem.endswith(DRAWN)
    return path.suffix.lower() in VIDEO_INPUT_SUFFIXES and not is_skipped


def _reject_unreadable(error: OSError) -> None:
    raise BatchError(f"{error.filename}: cannot be read: {error.strerror}; remove it") from error
