"""Formats of tracks, and the choice of the format of a file.

Formats are registered in the group `vdet.formats`: see `vdet.plugins`.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from vdet.config.classes import UNKNOWN
from vdet.errors import OutputError, TruthError
from vdet.findings import Finding
from vdet.labels.label import SavedTracks, SourceVideo, numbered_lines
from vdet.plugins import FORMATS, load_plugin, plugin_names
from vdet.track.track import FrameTracks


@dataclass(frozen=True, slots=True)
class Format:
    """A format of tracks.

    Attributes
    ----------
    name
        For messages.
    suffix
        Ending of its file names, lower case, with a leading dot.
    read
        Function that takes the path of a file, for messages, and its content. It raises
        `TruthError` with the position of the first mistake; its labels are not checked elsewhere.
    frame_lines, heading
        For a format with lines for each frame: function that returns the lines, with line ends, and
        the first line of the file.
    write_video
        For a format that is written at the end: function that writes all frames of a video.
    read_head
        Function like `read` for the first lines of a file; None if they have no times.
    """

    name: str
    suffix: str
    read: Callable[[Path, bytes], SavedTracks]
    frame_lines: Callable[[FrameTracks], Iterable[str]] | None = None
    heading: str = ""
    write_video: Callable[[BinaryIO, SourceVideo, Sequence[FrameTracks]], None] | None = None
    read_head: Callable[[Path, bytes], SavedTracks] | None = None


VIDEO, FINDINGS, LAST = "video", "findings", "last"
"""Names of the facts about a video, of its first frame; of its findings, of its last; and, of both,
whether the frame is the last, so that a file that was cut off is noticed.
"""


class TrackWriter:
    """Writes the tracks of a video into a binary file, each frame when the next one is known."""

    def __init__(self, form: Format, file: BinaryIO, video: SourceVideo) -> None:
        self._form, self._file, self._video = form, file, video
        self._kept: list[FrameTracks] = []
        self._last: FrameTracks | None = None
        self._file.write(form.heading.encode())

    def write(self, frame: FrameTracks) -> None:
        """Add a frame."""
        if not self._form.frame_lines:
            self._kept.append(replace(frame, facts={}))
            return
        if self._last:
            self._write_lines(self._last)
        else:
            values = self._video.record()
            frame = replace(frame, facts={VIDEO: values, LAST: False, **frame.facts})
        self._last = frame

    def end(self, findings: tuple[Finding, ...] = ()) -> None:
        """Write everything that is left, with the findings. Not called after an error."""
        if self._form.write_video:
            self._form.write_video(self._file, replace(self._video, findings=findings), self._kept)
        elif self._last:
            said = {FINDINGS: [finding.record() for finding in findings]} if findings else {}
            facts = {**self._last.facts, LAST: True, **said}
            self._write_lines(replace(self._last, facts=facts))

    def _write_lines(self, frame: FrameTracks) -> None:
        assert self._form.frame_lines
        self._file.writelines(line.encode() for line in self._form.frame_lines(frame))


def last_classes(frames: Iterable[FrameTracks]) -> dict[int, str]:
    """Return the class that each track has in its last frame, or `UNKNOWN`, by ascending id."""
    classes = {t.id: t.class_name or UNKNOWN for frame in frames for t in frame.tracks}
    return dict(sorted(classes.items()))


def track_formats() -> list[Format]:
    """Return all formats of tracks, those of vdet first. Raises `ConfigError`."""
    return [load_plugin(FORMATS, name) for name in plugin_names(FORMATS)]


def track_suffixes() -> list[str]:
    """Return the endings of files of tracks."""
    return [form.suffix for form in track_formats()]


def format_for(path: Path) -> Format | None:
    """Return the format by the ending of a name; None if it is unknown."""
    matching = [form for form in track_formats() if path.name.lower().endswith(form.suffix)]
    return max(matching, key=lambda form: len(form.suffix), default=None)


def check_track_name(path: Path) -> None:
    """Raise `OutputError` for `.kitti.txt`, which 1.0 wrote; MOTChallenge has its ending, too."""
    if path.name.lower().endswith(".kitti.txt"):
        raise OutputError(f"{path}: KITTI tracks are no longer written; use .txt or .coco.json")


_AMBIGUOUS = (".txt", ".csv")
"""Endings of several formats; the first line of the file decides."""


def recognize(path: Path, data: bytes) -> Format:
    """Return the format of a file, by its name, or by its content if the name is ambiguous.

    Raises
    ------
    TruthError
        The file is empty, and the ending of its name is unknown; its columns are not separated by
        commas; or it is XML.
    """
    by_name = format_for(path)
    if by_name and by_name.suffix not in _AMBIGUOUS:
        return by_name
    content = _format_name(path, data)
    form: Format | None = load_plugin(FORMATS, content) if content else by_name
    if form is None:
        suffixes = ", ".join(track_suffixes())
        raise TruthError(f"{path}: is empty; tracks and ground truth must be one of {suffixes}")
    return form


def _format_name(path: Path, data: bytes) -> str | None:
    """Return the registered name of the format of a file; None if it is empty."""
    _, first = next(numbered_lines(path, data), (0, ""))
    if not first:
        return None
    if first.startswith("<"):
        raise TruthError(f"{path}: XML is not supported; export the labels as COCO")
    if first[0] in "{[":
        return "coco"
    if re.match(r"\S+ \S+ [A-Za-z]", first):
        raise TruthError(f"{path}: KITTI tracks are no longer read; use MOTChallenge or COCO")
    starts_with_number = first[0] in "0123456789+-."
    if "," in first or (starts_with_number and ";" not in first):
        return "mot" if starts_with_number else "csv"
    separator = "tabs" if "\t" in first else "semicolons" if ";" in first else "spaces"
    raise TruthError(
        f"{path}: columns are separated by {separator}; they must be separated by commas, as in "
        "MOTChallenge and CSV"
    )
