"""Labelled boxes of a video, and the formats of files of them.

The limits, parsers and checks that apply to every format are here too. Formats are registered in
the group `vdet.formats`: see `vdet.plugins`.
"""

import codecs
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from itertools import chain
from operator import attrgetter
from pathlib import Path, PurePath, PurePosixPath
from typing import Annotated, Any, BinaryIO

import numpy as np
import pydantic
from pydantic import AwareDatetime, Field, TypeAdapter, ValidationError

from vdet.boxes import Box, Float64Array
from vdet.config.classes import UNKNOWN, standard_class
from vdet.config.scene import EARLIEST, LATEST
from vdet.errors import OutputError, TruthError
from vdet.files import read_whole
from vdet.findings import Finding
from vdet.plugins import FORMATS, load_plugin, plugin_names
from vdet.track.track import FrameTracks, Track

_VARIES = 0.1
"""Maximum deviation of the mean frame rate at the start of a file from that after it."""
_ROUNDING = 5e-4
"""Maximum error of the times of findings, seconds."""
NO_ID = -1
"""Id of a box without an id; in video, only ignore regions may have it."""

Size = tuple[int, int]
"""Width and height in pixels."""

Frames = Mapping[int, Sequence[Track]]
"""The boxes of each frame that has one, by its number from 0, in the order of a file."""

LIMIT = 10_000_000
"""Maximum frame number, id or pixel coordinate. Larger numbers mean damage, and would overflow."""

MAX_BYTES = 300_000_000
"""Maximum size of a file of boxes, unpacked."""

_LAST_NUMBER = re.compile(r"(?<![0-9])([0-9]{1,8})$", re.ASCII)
_LATEST = 1e11
"""Maximum time in seconds, three thousand years of wall-clock time."""
_MAX_RATE = 10_000
"""Maximum frames per second on average; times in days have more."""

Number = Annotated[float, Field(ge=-LIMIT, le=LIMIT, allow_inf_nan=False)]
Index = Annotated[int, Field(ge=0, le=LIMIT)]
"""Fields of JSON documents and of tables."""

Times = dict[int, tuple[int | str, float]]
"""The position in the file and the time, seconds, of each frame, counted from 0."""

VIDEO, FINDINGS, LAST = "video", "findings", "last"
"""Names of the facts about a video, of its first frame; of its findings, of its last; and, of both,
whether the frame is the last, so that a file that was cut off is noticed.
"""

_AMBIGUOUS = (".txt", ".csv")
"""Endings of several formats; the first line of the file decides."""


def may_be_same(first: str, second: str) -> bool:
    """Return whether two paths have the same name, and the same last folders, if both have any."""
    paths = (PurePath(path).parts[::-1] for path in (first, second))
    return all(a == b for a, b in zip(*paths, strict=False))


def boxes_of(tracks: Iterable[Track]) -> Float64Array:
    """Return x1, y1, x2, y2 of tracks in pixels from 0, float64 `(n, 4)`."""
    boxes = (track.box for track in tracks)
    return np.array([(b.x1, b.y1, b.x2, b.y2) for b in boxes], np.float64).reshape(-1, 4)


def line_error(path: Path | str, position: int | str, message: str) -> TruthError:
    """Return the error for a mistake in a line, or at another position, of a file."""
    return TruthError(f"{path}:{position}: {message}")


def check_frames(path: Path, frames: Frames) -> None:
    """Check that the boxes of the file `path` can all be of one video.

    Raises
    ------
    TruthError
        A frame before the first, a negative id of a vehicle, an id twice in a frame, or a box
        without area.
    """
    for index, tracks in frames.items():
        ids = set[int]()
        for track in tracks:
            mistake, id_ = mistake_in_box(track.box), track.id
            if index < 0:
                mistake = "the frame comes before the video's first"
            elif id_ < (NO_ID if track.ignored else 0):
                mistake = f"id {id_} is negative; number the vehicles from 0 or 1"
            elif id_ in ids and id_ != NO_ID:
                mistake = f"id {id_} occurs twice in the same frame"
            if mistake is not None:
                raise line_error(path, track.position, mistake)
            ids.add(id_)


def mistake_in_box(box: Box) -> str | None:
    """Return what is wrong with a box; None if nothing is."""
    width, height = box.x2 - box.x1, box.y2 - box.y1
    if width <= 0 or height <= 0 or width * height <= 0:
        return f"the box has no area: {width:g} wide, {height:g} high"
    return None


@pydantic.dataclasses.dataclass(frozen=True, slots=True)
class SourceVideo:
    """What a file of tracks says of its video.

    Attributes
    ----------
    name
        The path as it was given.
    width, height
        Size of the upright frames, pixels.
    rate
        Frames per second, on average.
    length
        Duration as the file declares it, seconds; None if unknown.
    start, end
        The part that was processed, seconds from the first frame; None: no limit.
    begin, begin_source
        The moment of time 0, and where that is from; None if unknown.
    classes
        The classes of vehicles that were kept; empty for all.
    program, settings
        What wrote the file, and its settings apart from the defaults.
    findings
        The reasons to doubt the tracks.
    """

    name: str
    width: int = Field(ge=1, le=100_000)
    height: int = Field(ge=1, le=100_000)
    rate: float | None = None
    length: float | None = None
    start: float | None = None
    end: float | None = None
    begin: Annotated[AwareDatetime, Field(ge=EARLIEST, le=LATEST)] | None = None
    begin_source: str | None = None
    classes: tuple[str, ...] = ()
    program: str = ""
    settings: dict[str, Any] = Field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def record(self) -> dict[str, Any]:
        """Return it as values for JSON, without what is unknown."""
        values: dict[str, Any] = TypeAdapter(SourceVideo).dump_python(
            self, mode="json", exclude_defaults=True, exclude={"findings"}
        )
        records = [finding.record() for finding in self.findings]
        return {**values, "findings": records} if records else values


@dataclass(frozen=True, slots=True)
class SavedTracks:
    """The tracks of a video, read from a file.

    Attributes
    ----------
    frames
        The boxes, exactly as in the file.
    covered
        The frames that the file covers, also those without a box, counted from 0, ascending; None:
        all up to its last box.
    times
        Seconds of each frame with a time in the file; empty if the format has no times.
    size
        Width and height of the frames in pixels; None if the file does not contain them.
    begin
        The moment of time 0, the first frame of the video, if the file has it.
    begin_source
        Where that is from.
    video
        What the file says of its video; None for formats that cannot hold it.
    """

    frames: Frames
    covered: Sequence[int] | None = None
    times: Mapping[int, float] = field(default_factory=dict)
    size: tuple[int, int] | None = None
    begin: datetime | None = None
    begin_source: str = "from the file"
    video: SourceVideo | None = None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Reasons to doubt the tracks."""
        return self.video.findings if self.video else ()

    @property
    def has_times(self) -> bool:
        """Whether every frame has a time; if not, pass a rate to `at_rate`."""
        return self._indices() <= self.times.keys()

    @property
    def first_time(self) -> float:
        """Time of the first frame, seconds; 0 if there is none."""
        return min(self.times.values(), default=0.0)

    def from_first_frame(self) -> "SavedTracks":
        """Return the same tracks at the times since the first frame of the video, seconds.

        Times of other programs and of older files may be those in the container, or of a clock. If
        the first frame is not in the file, its time follows from the rate of the others.
        """
        indices = sorted(self.times)[:2]
        if not indices:
            return self
        first, second = indices[0], indices[-1]
        origin, rate = self.times[first], self.video and self.video.rate
        if first:
            step = (self.times[second] - origin) / max(1, second - first)
            before = first / rate if rate else first * step
            origin -= before
            if origin <= max(1.0, _VARIES * before):
                return self
        if not origin:
            return self
        times = {index: round(time - origin, 6) for index, time in self.times.items()}
        begin = self.begin and self.begin + timedelta(seconds=origin)
        return replace(self, times=times, begin=begin)

    def of_video(self, video: SourceVideo) -> "SavedTracks":
        """Return the same tracks with what the file says of their video."""
        return replace(
            self,
            video=video,
            size=(video.width, video.height),
            begin=self.begin or video.begin,
            begin_source=video.begin_source or self.begin_source,
        )

    def at_rate(self, rate: float) -> "SavedTracks":
        """Return the same tracks; frames without a time get that of `rate` frames per second."""
        times = {index: index / rate for index in self._indices()}
        return replace(self, times=times | dict(self.times))

    def __iter__(self) -> Iterator[FrameTracks]:
        """Yield the frames with a box and the covered frames, in order.

        Boxes are rounded to whole pixels, and scores lie between 0 and 1. A class is one of
        `STANDARD_CLASSES` if the label means one, else the label. An unknown time is NaN: see
        `has_times`.
        """
        frames, before = self.named_frames(), -math.inf
        cuts = [first for item in self.findings if item.code == "cut" for first, _ in item.spans]
        for index in sorted(self._indices()):
            tracks = sorted(frames.get(index, ()), key=attrgetter("id"))
            time = self.times.get(index, math.nan)
            is_cut = any(before < cut - _ROUNDING <= time for cut in cuts)
            before = time
            yield FrameTracks(index, time, tuple(tracks), is_cut=is_cut)

    @property
    def tracks(self) -> Iterator[Track]:
        """The boxes of all frames."""
        return chain.from_iterable(self.frames.values())

    def named_frames(self) -> Frames:
        """Return the frames, ascending, with `STANDARD_CLASSES` for the names that mean one."""
        words = {track.class_name for track in self.tracks}
        names = {word: word and (standard_class(word) or word) for word in words}
        return {
            index: [
                track
                if names[track.class_name] == track.class_name
                else replace(track, class_name=names[track.class_name])
                for track in tracks
            ]
            for index, tracks in sorted(self.frames.items())
        }

    @property
    def length(self) -> int:
        """Number of frames up to the last that is covered or has a box."""
        return max(self._indices(), default=-1) + 1

    def until(self, end: int) -> "SavedTracks":
        """Return the frames before `end`."""
        frames = {at: tracks for at, tracks in self.frames.items() if at < end}
        covered = None if self.covered is None else [at for at in self.covered if at < end]
        return replace(self, frames=frames, covered=covered)

    def spread(self, every: int, first: int, end: int) -> set[int]:
        """Return covered frames from `first` until before `end`, each `every` or more apart."""
        chosen, earliest = set(), first
        for index in range(end) if self.covered is None else self.covered:
            if earliest <= index < end:
                chosen.add(index)
                earliest = index + every
        return chosen

    def check_end(self, video: Path, frames: int) -> None:
        """Raise `TruthError` if there is a box beyond the last frame of the file `video`."""
        count = max(self.frames, default=-1) + 1
        if count > frames:
            raise TruthError(
                f"{video}: has {frames} frames, but its ground truth has a box in frame {count}"
            )

    def _indices(self) -> set[int]:
        return set(self.frames).union(self.covered or ())


def read_bytes(path: Path) -> bytes:
    """Return the content of a file. Raises `TruthError` if it is larger than `MAX_BYTES`."""
    return read_whole(path, limit=MAX_BYTES, what="file of boxes", error=TruthError)


def numbered_lines(path: Path | str, data: bytes) -> Iterator[tuple[int, str]]:
    """Yield every line that is not blank, stripped, with its number from 1.

    Raises
    ------
    TruthError
        The content is not UTF-8.
    """
    try:
        for number, line in enumerate(io.BytesIO(data.removeprefix(codecs.BOM_UTF8)), start=1):
            if stripped := line.decode().strip():
                yield number, stripped
    except UnicodeDecodeError as error:
        raise TruthError(f"{path}: is not a text file (UTF-8) of tracks or labels") from error


def frame_number(name: str) -> int | None:
    """Return the frame number at the end of a file name; None without one."""
    number = _LAST_NUMBER.search(PurePosixPath(name).stem)
    return int(number[1]) if number else None


def checked_times(path: Path, times: Times) -> dict[int, float]:
    """Return the time of each frame.

    Times may be wall-clock times. The first one may be negative, as in videos.

    Raises
    ------
    TruthError
        A time is not a number, is too large, is less than that of an earlier frame, or cannot be
        in seconds.
    """
    latest = -_LATEST
    ordered = sorted(times.items())
    for frame, (position, time) in ordered:
        if not latest <= time <= _LATEST:
            message = f"frame {frame} is at {time:g} s; times must be numbers and must not decrease"
            raise line_error(path, position, message)
        latest = time
    if ordered and (ordered[-1][0] - ordered[0][0]) > _MAX_RATE * (latest - ordered[0][1][1]):
        fault = f"more than {_MAX_RATE:,} frames a second; times must be seconds"
        raise line_error(path, ordered[-1][1][0], fault)
    return {frame: time for frame, (_, time) in times.items()}


def first_mistake(error: ValidationError) -> str:
    """Return one line that describes the first mistake in a document, and its position."""
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    position = ".".join(str(part) for part in first["loc"])
    message = first["msg"].removeprefix("Value error, ")
    return f"{position}: {message}" if position else message


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
